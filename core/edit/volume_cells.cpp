#include "core/edit/volume_cells.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "core/base/errors.h"
#include "core/edit/vote_grid.h"

namespace fieldgraft {

namespace {

// Numbers the piece that holds the cell `start` (flat index), and returns its size.
std::int64_t flood(const std::uint8_t* cells, std::vector<int>& piece, std::int64_t start, std::int64_t r, int number) {
    std::vector<std::int64_t> open{start};
    piece[start] = number;
    std::int64_t size = 0;
    while (!open.empty()) {
        const std::int64_t at = open.back(), z = at / (r * r), y = at / r % r, x = at % r;
        open.pop_back();
        ++size;
        for (std::int64_t k = std::max<std::int64_t>(z - 1, 0); k <= std::min(z + 1, r - 1); ++k)
            for (std::int64_t j = std::max<std::int64_t>(y - 1, 0); j <= std::min(y + 1, r - 1); ++j)
                for (std::int64_t i = std::max<std::int64_t>(x - 1, 0); i <= std::min(x + 1, r - 1); ++i) {
                    const std::int64_t next = (k * r + j) * r + i;
                    if (!cells[next] || piece[next]) continue;
                    piece[next] = number;
                    open.push_back(next);
                }
    }
    return size;
}

}  // namespace

Tensor cells_above(const FieldGeometry& geometry, const Tensor& region, double width) {
    const int resolution = static_cast<int>(region.size(0));
    const Tensor centres = cell_centres(geometry, resolution);
    const Tensor in_region = region.reshape(-1).to(at::kBool);
    if (!in_region.any().item<bool>()) throw std::invalid_argument("cells_above: the region is empty");
    const Tensor up = at::tensor({geometry.up[0], geometry.up[1], geometry.up[2]}, at::kFloat);
    const Tensor axis = up / up.norm();
    const Tensor height = centres.matmul(axis), flat = centres - height.unsqueeze(1) * axis;
    const Tensor heights = height.masked_select(in_region), spread = flat.index({in_region});
    const float top = heights.max().item<float>(), bottom = heights.min().item<float>();
    // The middle of the topmost tenth, and the region's lesser width at right angles to `up`.
    const Tensor upper = in_region.logical_and(height > top - 0.1f * (top - bottom) - 1e-6f);
    const Tensor middle = flat.index({upper}).mean(0);
    const Tensor extents = std::get<0>((spread.amax(0) - spread.amin(0)).sort(0, true));
    const float radius = static_cast<float>(width) / 2 * extents[1].item<float>();
    const Tensor from_centre = (flat - middle).square().sum(1) + (height - top - 0.8f * radius).square();
    const Tensor cells = from_centre <= radius * radius;
    return cells.reshape({resolution, resolution, resolution}).to(at::kByte);
}

Tensor without_specks(const Tensor& cells, double share) {
    Tensor kept = cells.to(at::kByte).contiguous().clone();
    const std::int64_t r = kept.size(0);
    auto* cell = kept.data_ptr<std::uint8_t>();
    std::vector<int> piece(kept.numel(), 0);
    std::vector<std::int64_t> sizes{0};
    for (std::int64_t i = 0; i < kept.numel(); ++i)
        if (cell[i] && !piece[i]) sizes.push_back(flood(cell, piece, i, r, static_cast<int>(sizes.size())));
    const double least = share * static_cast<double>(*std::max_element(sizes.begin(), sizes.end()));
    for (std::int64_t i = 0; i < kept.numel(); ++i)
        if (static_cast<double>(sizes[piece[i]]) < least) cell[i] = 0;
    return kept;
}

Tensor cut_off_pieces(const Tensor& whole, const Tensor& part, double share) {
    const Tensor rest = whole.to(at::kBool).logical_and(part == 0);
    return rest.logical_and(without_specks(rest, share) == 0).to(at::kByte);
}

}  // namespace fieldgraft
