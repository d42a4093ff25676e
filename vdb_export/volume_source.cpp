#include "vdb_export/volume_source.h"

#include "core/field/cells.h"
#include "core/field/diffuse_color.h"

namespace fieldgraft {
namespace {

// f's density, 0 where the renderer does not march: outside the occupied cells.
RadianceField::DensityOut field_density(const RadianceField& field, const Tensor& positions) {
    RadianceField::DensityOut out = field.density(positions);
    out.density =
        at::where(in_cells(field.geometry(), field.occupancy(), positions), out.density, at::zeros_like(out.density));
    return out;
}

Tensor density_at(const RadianceField& field, const EditStack& items, const Tensor& positions) {
    at::NoGradGuard no_grad;
    const Tensor rows = in_cells(field.geometry(), field.occupancy(), positions).nonzero().squeeze(1);
    Tensor density = at::zeros({positions.size(0)}, at::kFloat);
    density.index_copy_(0, rows, field.density(positions.index_select(0, rows)).density);
    Medium medium{density, at::zeros({1, 1}, at::kFloat)};  // the mixture needs a colour: a single value stands for it
    for (const StackItem& item : items) {
        if (!item.active().add && !item.active().remove) continue;
        EditSamples edit = evaluate(item, positions);
        edit.beta_color = Tensor();
        edit.color_e = medium.color;
        medium = blended_medium(medium, edit);
    }
    return medium.density;
}

Tensor color_at(const RadianceField& field, const EditStack& items, const Tensor& positions) {
    at::NoGradGuard no_grad;
    const RadianceField::DensityOut base = field_density(field, positions);
    Medium medium{base.density, diffuse_color(field, base.features)};
    for (const StackItem& item : items) medium = blended_medium(medium, evaluate(item, positions));
    return medium.color;
}

std::vector<Tensor> occupied_cells(const RadianceField& field, const EditStack& items) {
    if (!field.occupancy().defined()) return {};
    std::vector<Tensor> grids{field.occupancy()};
    for (const StackItem& item : items) {
        if (!item.active().add) continue;
        if (!item.field->support().defined()) return {};
        grids.push_back(item.field->support());
    }
    return grids;
}

}  // namespace

VolumeSource volume_source(const RadianceField& field, const EditStack& stack) {
    check_stack(field, stack);
    const EditStack items = active_items(stack);
    return {[&field, items](const Tensor& positions) { return density_at(field, items, positions); },
            [&field, items](const Tensor& positions) { return color_at(field, items, positions); },
            occupied_cells(field, items)};
}

}  // namespace fieldgraft
