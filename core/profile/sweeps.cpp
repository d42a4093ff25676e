#include "core/profile/sweeps.h"

#include "core/base/errors.h"

namespace fieldgraft {

const std::vector<std::string>& known_sweeps() {
    static const std::vector<std::string> names{"training", "rendering", "editing", "baking"};
    return names;
}

std::vector<Measure> measures_of(const std::string& sweep) {
    if (sweep == "training") return {{"psnr", "PSNR of test views", "dB"}};
    if (sweep == "rendering") return {{"psnr", "PSNR to the converged pictures", "dB"}};
    if (sweep == "editing")
        return {{"mp_clip", "MP_CLIP by the judge", ""},
                {"s_clip", "S_CLIP by the judge", ""},
                {"d_l1_outside", "change outside the region, D_L1", "", false}};
    if (sweep == "baking")
        return {{"psnr", "PSNR of the grid's pictures to the field's", "dB"}, {"mib", "file, MiB", "", false}};
    throw std::invalid_argument(fmt::format("no sweep \"{}\"", sweep));
}

std::string time_of(const std::string& sweep) {
    return sweep == "rendering"  ? "seconds a view"
           : sweep == "training" ? "seconds of training"
           : sweep == "editing"  ? "seconds of the edit"
                                 : "seconds of the bake";
}

}  // namespace fieldgraft
