#include "core/field/file_parts.h"

#include "core/base/errors.h"
#include "core/base/shape.h"

namespace fieldgraft {

void check_format(const SafeTensors& file, const std::string& format, const std::string& what) {
    const auto found = file.metadata.find("format");
    const std::string its = found == file.metadata.end() ? "" : found->second;
    if (its != format)
        input_error("{}: not {} file (its format is \"{}\", \"{}\" is needed)", file.origin, what, its, format);
}

const std::string& metadata_at(const SafeTensors& file, const std::string& key) {
    const auto found = file.metadata.find(key);
    if (found == file.metadata.end())
        input_error("{}: no \"{}\" in its metadata; is it a file of fieldgraft's?", file.origin, key);
    return found->second;
}

Json metadata_json(const SafeTensors& file, const std::string& key) {
    Json json = Json::parse(metadata_at(file, key), nullptr, false);
    if (json.is_discarded()) input_error("{}: \"{}\" in its metadata is not JSON", file.origin, key);
    return json;
}

Tensor parameter_at(const SafeTensors& file, const std::string& name, at::IntArrayRef shape) {
    const Tensor& tensor = file.at(name);
    if (tensor.scalar_type() != at::kFloat || tensor.sizes() != shape)
        input_error("{}: \"{}\" must be float32 {}, not {} {}", file.origin, name,
                    shape_text(at::empty(shape, at::kMeta)), at::toString(tensor.scalar_type()), shape_text(tensor));
    if (!tensor.isfinite().all().item<bool>())
        input_error("{}: \"{}\" holds numbers that are not finite", file.origin, name);
    return tensor.clone();
}

}  // namespace fieldgraft
