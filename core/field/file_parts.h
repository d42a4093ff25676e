// What field and edit files have in common: a format name, JSON in the metadata, float32 parameters. All throw
// InputError naming the file.
#pragma once

#include "core/base/json.h"
#include "core/base/safetensors.h"

namespace fieldgraft {

// `what`: "a field", "an edit".
void check_format(const SafeTensors& file, const std::string& format, const std::string& what);
const std::string& metadata_at(const SafeTensors& file, const std::string& key);
Json metadata_json(const SafeTensors& file, const std::string& key);
// A copy of the tensor, of that shape and finite.
Tensor parameter_at(const SafeTensors& file, const std::string& name, at::IntArrayRef shape);

}  // namespace fieldgraft
