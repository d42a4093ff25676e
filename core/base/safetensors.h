// The safetensors file format (8-byte little-endian header length, JSON header, raw tensor data).
// Dtypes: F64 F32 F16 BF16 I64 I32 U8 BOOL. Tensors are written sorted by name, so that equal content gives equal
// bytes.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/base/torch.h"

namespace fieldgraft {

struct SafeTensors {
    std::map<std::string, Tensor> tensors;        // contiguous, CPU
    std::map<std::string, std::string> metadata;  // "__metadata__": strings only

    // The tensor of that name; throws InputError naming the file's missing tensor.
    const Tensor& at(const std::string& name) const;
    std::string origin;  // the file it came from, for messages
};

// Throws InputError for a missing, truncated or malformed file (offsets out of range, overlapping, wrong byte counts).
SafeTensors load_safetensors(const std::filesystem::path& path);
// Atomic: a temporary file, then a rename.
void save_safetensors(const std::filesystem::path& path, const std::map<std::string, Tensor>& tensors,
                      const std::map<std::string, std::string>& metadata = {});
// The name of a tensor that holds a NaN or an Inf; empty if none does.
std::string not_finite(const std::map<std::string, Tensor>& tensors);
// What is learnt is written only if it is finite: throws Failure, naming the file that was not written.
void save_finite_safetensors(const std::filesystem::path& path, const std::map<std::string, Tensor>& tensors,
                             const std::map<std::string, std::string>& metadata = {});
// SHA-256 (hex) over names, dtypes, shapes and bytes of the tensors; metadata does not enter.
std::string content_hash(const std::map<std::string, Tensor>& tensors);

}  // namespace fieldgraft
