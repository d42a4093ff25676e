#include "core/render/blended_pass.h"

#include <algorithm>
#include <cmath>

#include "core/base/errors.h"
#include "core/base/spans.h"
#include "core/field/cells.h"
#include "core/field/kernel_edit.h"
#include "core/kernels/blend_ref.h"
#include "core/kernels/exp_simd.h"
#include "core/render/block_colors.h"
#include "core/render/ray_ranges.h"

namespace fieldgraft {
namespace {

struct StackEdit {
    KernelEdit g;
    Operations on;
    // Asked wherever rays look, as it decides where they end: what it takes away hides nothing, and what it adds hides
    // where no map has to see behind that (`removed` and the maps of edits below do).
    bool ends_rays = false;
};

// What the stack's edits have to say of where rays end. Those that do not decide it are asked later, of the samples
// that can be seen alone.
class EditProbe : public SampleProbe {
  public:
    // edits must outlive it. own: f's cells, where rays also look elsewhere.
    EditProbe(const std::vector<StackEdit>& edits, UnitCells own) : edits_(edits), own_(std::move(own)) {}
    std::size_t columns() const override { return edits_.size() * KernelEdit::row; }
    const UnitCells& own_cells() const override { return own_; }
    void look(const float* positions, std::size_t n, const float* density, float* hiding, float* rows) const override {
        const std::size_t stride = columns();
        std::copy_n(density, n, hiding);
        for (std::size_t e = 0; e < edits_.size(); ++e) {
            if (!edits_[e].ends_rays) continue;
            float* own = rows + e * KernelEdit::row;
            edits_[e].g.evaluate(positions, n, own, stride);
            for (std::size_t s = 0; s < n; ++s) {
                const float* row = own + s * stride;
                hiding[s] = edits_[e].on.remove ? (1 - row[KernelEdit::beta_density]) * hiding[s]
                                                : hiding[s] + row[KernelEdit::density_e];
            }
        }
    }

  private:
    const std::vector<StackEdit>& edits_;
    const UnitCells own_;
};

// Exponentials of many samples at once: what no edit touches is drawn elsewhere and has its own.
const BlendMath<float>& vector_math() {
    static const BlendMath<float> math{exp_negative, one_minus_exp_negative};
    return math;
}

// f's cells and those where density may be added; undefined: the whole box.
Tensor visited_cells(const RadianceField& field, const EditStack& items) {
    Tensor visited = field.occupancy();
    for (const StackItem& item : items) {
        if (!item.active().add || !visited.defined()) continue;
        const Tensor& support = item.field->support();
        visited = support.defined() ? union_of(visited, resampled_cells(support, static_cast<int>(visited.size(0))))
                                    : Tensor();
    }
    return visited;
}

// One level's heads, sample by sample.
struct Heads {
    std::vector<float> density_e, color_e, beta_density, beta_color;

    void take(const RayBlock& block, std::size_t edit, std::size_t stride) {
        const std::size_t n = block.samples();
        for (auto* head : {&density_e, &beta_density, &beta_color}) head->resize(n);
        color_e.resize(3 * n);
        for (std::size_t s = 0; s < n; ++s) {
            const float* row = block.probed.data() + s * stride + edit * KernelEdit::row;
            density_e[s] = row[KernelEdit::density_e];
            beta_density[s] = row[KernelEdit::beta_density];
            beta_color[s] = row[KernelEdit::beta_color];
            std::copy_n(row + KernelEdit::color_e, 3, color_e.data() + 3 * s);
        }
    }
};

// What blended_medium (medium.h) is of tensors, in place.
void put_on(const Operations& on, const Heads& g, std::vector<float>& density, std::vector<float>& color) {
    for (std::size_t s = 0; s < density.size(); ++s) {
        float* c = color.data() + 3 * s;
        const float* edit = g.color_e.data() + 3 * s;
        for (int i = 0; i < 3 && on.change; ++i) c[i] = (1 - g.beta_color[s]) * c[i] + g.beta_color[s] * edit[i];
        if (on.remove) density[s] = (1 - g.beta_density[s]) * density[s];
        if (!on.add || !(g.density_e[s] > 0)) continue;
        const float share = 1 / (1 + density[s] / g.density_e[s]);
        for (int i = 0; i < 3; ++i) c[i] += share * (edit[i] - c[i]);
        density[s] += g.density_e[s];
    }
}

// Σ w t / Σ w of each ray (composite_ref.h), of the block's densities.
void find_depths(const RayBlock& block, std::span<float> depth) {
    const std::size_t n = block.samples();
    std::vector<float> front(n), own(n);
    for (std::int64_t r = 0; r < block.rays(); ++r) {
        double sum = 0;
        for (std::int64_t k = block.start[r]; k < block.start[r + 1]; ++k) {
            front[k] = static_cast<float>(sum);
            own[k] = std::min(block.density[k] * block.delta[k], 1e30f);
            sum += own[k];
        }
    }
    vector_math().passed(front.data(), n, front.data());
    vector_math().covered(own.data(), n, own.data());
    for (std::int64_t r = 0; r < block.rays(); ++r) {
        double weights = 0, weighted = 0;
        for (std::int64_t k = block.start[r]; k < block.start[r + 1]; ++k) {
            const double weight = static_cast<double>(front[k]) * own[k];
            weights += weight;
            weighted += weight * block.t[k];
        }
        depth[r] = weights > 0 ? static_cast<float>(weighted / weights) : 0.0f;
    }
}

BlendedRays empty_rays(std::int64_t count) {
    const auto zeros = [&] { return at::zeros({count}, at::kFloat); };
    return {at::zeros({count, 3}, at::kFloat),
            zeros(),
            zeros(),
            at::zeros({count, 3}, at::kFloat),
            zeros(),
            zeros(),
            zeros(),
            zeros(),
            zeros()};
}

// Draws ranges of rays; each is one thread's.
class BlendedPass {
  public:
    BlendedPass(const RadianceField& field, const EditStack& items, Compositing compositing, BlendedRays& out)
        : kernel_(field), compositing_(compositing), out_(out), transmittance_(at::empty_like(out.alpha)) {
        const Tensor visited = visited_cells(field, items);
        cells_ = march_grid_of(field.geometry(), visited.defined() ? visited.contiguous() : visited);
        bool beyond_own = false;
        for (const StackItem& item : items) {
            const Operations on = item.active();
            const bool ends_rays = on.remove || (on.add && items.size() == 1);
            edits_.push_back({{*item.field, {item.add, item.remove, item.change}}, on, ends_rays});
            beyond_own = beyond_own || item.active().add;
        }
        const UnitCells own(field.geometry(), beyond_own ? field.occupancy() : Tensor());
        probe_ = std::make_unique<EditProbe>(edits_, own);
    }

    void draw(const RayRange& rays) const {
        VisibleRays visible(kernel_, cells_, rays, VisibleRays::Encoded::dropped, probe_.get());
        RayBlock block;
        BlockColors colors;
        Heads heads;
        const std::size_t stride = probe_->columns();
        while (visible.next(block)) {
            colors.compute(kernel_, block);
            const std::size_t first = static_cast<std::size_t>(rays.first + block.begin);
            for (std::size_t e = 0; e < edits_.size(); ++e) {
                float* rows = block.probed.data() + e * KernelEdit::row;
                if (!edits_[e].ends_rays) edits_[e].g.evaluate(block.positions.data(), block.samples(), rows, stride);
                heads.take(block, e, stride);
                blend_level(edits_[e].on, block, colors.color, heads, first);
                put_on(edits_[e].on, heads, block.density, colors.color);
            }
            find_depths(block, mutable_values(out_.depth).subspan(first, static_cast<std::size_t>(block.rays())));
        }
    }
    // Once all ranges are drawn.
    void finish() const {
        at::sub_out(out_.alpha, at::ones_like(transmittance_), transmittance_);
        out_.edited.clamp_(0, 1);
    }

  private:
    void blend_level(const Operations& on, const RayBlock& block, const std::vector<float>& color, const Heads& g,
                     std::size_t first) const {
        const auto at = [&](const Tensor& t) {
            return t.mutable_data_ptr<float>() + first * static_cast<std::size_t>(t.dim() == 2 ? 3 : 1);
        };
        const BlendMode mode{on.add, on.remove, on.change, compositing_ == Compositing::conserving, true};
        const BlendInputs<float> in{block.start.data(), block.delta.data(), block.density.data(),  color.data(),
                                    g.density_e.data(), g.color_e.data(),   g.beta_density.data(), g.beta_color.data()};
        // An operation that is off writes nothing: what a lower level wrote must not stay.
        const std::size_t count = static_cast<std::size_t>(block.rays());
        for (const Tensor* map : {&out_.added, &out_.removed, &out_.changed, &out_.alpha_edit})
            std::fill_n(at(*map), count, 0.0f);
        std::fill_n(at(out_.color_edit), 3 * count, 0.0f);
        const BlendRays<float> out{at(out_.color), at(transmittance_), at(out_.color_edit), at(out_.alpha_edit),
                                   at(out_.added), at(out_.removed),   at(out_.changed)};
        blend_forward<float>(mode, in, out, 0, block.rays(), vector_math());
        for (std::size_t r = 0; r < count; ++r) at(out_.edited)[r] += out.added[r] + out.removed[r] + out.changed[r];
    }

    KernelField kernel_;
    Compositing compositing_;
    BlendedRays& out_;
    Tensor transmittance_;
    MarchGrid cells_;
    std::vector<StackEdit> edits_;
    std::unique_ptr<EditProbe> probe_;
};

}  // namespace

BlendedRays draw_blended(const RadianceField& field, const EditStack& items, const RayBundle& rays,
                         const MarchOptions& march, Compositing compositing) {
    at::NoGradGuard no_grad;
    if (items.empty()) throw std::invalid_argument("a blended picture needs an edit");
    BlendedRays out = empty_rays(rays.size());
    const BlendedPass pass(field, items, compositing, out);
    over_ray_ranges(field, rays, march, [&](const RayRange& range) { pass.draw(range); });
    pass.finish();
    return out;
}

}  // namespace fieldgraft
