#include "core/base/safetensors.h"

#include <gtest/gtest.h>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "tests/base/temp_folder.h"

namespace fieldgraft {
namespace {

std::map<std::string, Tensor> one_of_each() {
    const Tensor base = at::arange(6, at::kFloat).reshape({2, 3}) - 2.5;
    std::map<std::string, Tensor> tensors;
    for (const auto type : {at::kDouble, at::kFloat, at::kHalf, at::kBFloat16, at::kLong, at::kInt})
        tensors[std::string("t.") + c10::toString(type)] = base.to(type);
    tensors["bytes"] = at::arange(5, at::kByte);
    tensors["bools"] = base > 0;
    tensors["scalar"] = at::scalar_tensor(3.25, at::kFloat);
    tensors["empty"] = at::empty({0, 4}, at::kFloat);
    tensors["strided"] = base.t();
    return tensors;
}

// A file out of a header text and a count of data bytes.
std::string file_of(const std::string& header, std::size_t data) {
    std::string bytes(8, '\0');
    for (int i = 0; i < 8; ++i) bytes[i] = static_cast<char>(header.size() >> (8 * i));
    return bytes + header + std::string(data, '\1');
}

TEST(SafeTensors, EveryTypeComesBackBitForBit) {
    const TempFolder folder;
    const auto tensors = one_of_each();
    save_safetensors(folder / "a.safetensors", tensors, {{"format", "pt"}, {"note", "ünï \"x\""}});
    const SafeTensors file = load_safetensors(folder / "a.safetensors");
    ASSERT_EQ(file.tensors.size(), tensors.size());
    EXPECT_EQ(file.metadata.at("note"), "ünï \"x\"");
    for (const auto& [name, tensor] : tensors) {
        EXPECT_EQ(file.at(name).scalar_type(), tensor.scalar_type()) << name;
        EXPECT_TRUE(file.at(name).is_contiguous()) << name;
        EXPECT_TRUE(file.at(name).equal(tensor)) << name;
    }
    EXPECT_CONTAINS(message_of<InputError>([&] { file.at("nobody"); }), "no tensor 'nobody'");
}

TEST(SafeTensors, EqualContentGivesEqualBytesAndHash) {
    const TempFolder folder;
    const auto tensors = one_of_each();
    save_safetensors(folder / "a.safetensors", tensors);
    save_safetensors(folder / "b.safetensors", load_safetensors(folder / "a.safetensors").tensors);
    EXPECT_EQ(read_file(folder / "a.safetensors"), read_file(folder / "b.safetensors"));
    EXPECT_EQ(content_hash(tensors), content_hash(load_safetensors(folder / "b.safetensors").tensors));
    EXPECT_EQ(content_hash(tensors).size(), 64u);
}

TEST(SafeTensors, HashSeesNamesShapesTypesAndBytes) {
    const Tensor t = at::zeros({2, 3});
    const std::string hash = content_hash({{"a", t}});
    EXPECT_NE(content_hash({{"b", t}}), hash);
    EXPECT_NE(content_hash({{"a", t.reshape({3, 2})}}), hash);
    EXPECT_NE(content_hash({{"a", t.view(at::kInt)}}), hash);
    EXPECT_NE(content_hash({{"a", t + 1e-30f}}), hash);
    EXPECT_EQ(content_hash({{"a", t.clone()}}), hash);
}

// Written by the `safetensors` Python package; see tests/base/test_safetensors_golden.py.
TEST(SafeTensors, ReadsTheGoldenFile) {
    const SafeTensors file =
        load_safetensors(std::string(FIELDGRAFT_SOURCE_DIR) + "/tests/golden/safetensors/reference.safetensors");
    EXPECT_EQ(file.metadata.at("made_by"), "safetensors");
    EXPECT_TRUE(file.at("half").equal(at::arange(4, at::kFloat).reshape({2, 2}).to(at::kHalf) / 4));
    EXPECT_TRUE(file.at("bfloat").equal((at::arange(3, at::kFloat) - 1).to(at::kBFloat16)));
    EXPECT_TRUE(file.at("float").equal(at::arange(6, at::kFloat).reshape({1, 2, 3}) * 0.5));
    EXPECT_TRUE(file.at("long").equal(at::arange(3, at::kLong) - (std::int64_t{1} << 40)));
    const Tensor bools = file.at("bool");
    EXPECT_TRUE(bools[0].item<bool>());
    EXPECT_FALSE(bools[1].item<bool>());
}

// … and this file, written by us, is read back by the package in that Python test.
TEST(SafeTensors, OurBytesAreTheGoldenBytes) {
    const TempFolder folder;
    save_safetensors(folder / "ours.safetensors",
                     {{"b.half", (at::arange(4, at::kFloat) / 8).to(at::kHalf)},
                      {"a.float", at::arange(6, at::kFloat).reshape({2, 3})},
                      {"c.bfloat", at::arange(2, at::kFloat).to(at::kBFloat16)},
                      {"d.long", at::arange(2, at::kLong)}},
                     {{"config", "{\"x\": 1}"}});
    const std::string golden = std::string(FIELDGRAFT_SOURCE_DIR) + "/tests/golden/safetensors/ours.safetensors";
    const char* update = std::getenv("FIELDGRAFT_UPDATE_GOLDEN");
    if (update != nullptr && std::string(update) == "1") write_file(golden, read_file(folder / "ours.safetensors"));
    EXPECT_EQ(read_file(folder / "ours.safetensors"), read_file(golden));
}

TEST(SafeTensors, MalformedFilesAreInputErrors) {
    const TempFolder folder;
    const auto reject = [&](const std::string& bytes, const std::string& part) {
        write_file(folder / "bad.safetensors", bytes);
        const std::string text = message_of<InputError>([&] { load_safetensors(folder / "bad.safetensors"); });
        EXPECT_CONTAINS(text, "bad.safetensors");
        EXPECT_CONTAINS(text, part);
    };
    const auto tensor = [](const std::string& rest) { return "{\"t\":{" + rest + "}}"; };
    reject("abc", "3 bytes");
    reject(std::string(8, '\xff'), "header should take");
    reject(file_of("[1]", 0), "not a JSON object");
    reject(file_of("{\"t\":", 0), "not a JSON object");
    reject(file_of(tensor("\"dtype\":\"F32\",\"shape\":[2]"), 8), "lacks dtype");
    reject(file_of(tensor("\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,8]"), 4), "ends at byte 8");
    reject(file_of(tensor("\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,4]"), 4), "needs 8 bytes");
    reject(file_of(tensor("\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[8,0]"), 8), "needs 8 bytes");
    reject(file_of(tensor("\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,8]"), 9), "1 bytes follow");
    reject(file_of(tensor("\"dtype\":\"F32\",\"shape\":[-2],\"data_offsets\":[0,8]"), 8), "whole number");
    reject(file_of(tensor("\"dtype\":\"F32\",\"shape\":[4611686018427387904,4],\"data_offsets\":[0,8]"), 8),
           "impossible");
    reject(file_of(tensor("\"dtype\":\"F99\",\"shape\":[2],\"data_offsets\":[0,8]"), 8), "supported are");
    reject(file_of(tensor("\"dtype\":\"BOOL\",\"shape\":[1],\"data_offsets\":[1,2]"), 2), "begins at byte 1");
    reject(file_of("{\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0,2]},"
                   "\"b\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[1,3]}}",
                   3),
           "begins at byte 1");
    reject(file_of("{\"__metadata__\":{\"a\":1}}", 0), "not a string");
    // A whole file cut anywhere is an error, never a crash.
    save_safetensors(folder / "good.safetensors", one_of_each());
    const std::string good = read_file(folder / "good.safetensors");
    for (std::size_t size = 0; size < good.size(); size += 7) reject(good.substr(0, size), "");
}

}  // namespace
}  // namespace fieldgraft
