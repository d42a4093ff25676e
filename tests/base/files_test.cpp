#include "core/base/files.h"

#include <gtest/gtest.h>

#include <fstream>

#include "core/base/errors.h"
#include "core/base/json.h"
#include "tests/base/temp_folder.h"

namespace fieldgraft {
namespace fs = std::filesystem;

namespace {

std::size_t entries(const fs::path& folder) {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(Files, WritesAndReadsBytesAndMakesFolders) {
    const TempFolder folder;
    const std::string bytes("a\0b\r\n\xff", 6);
    write_file(folder / "deep/er/file.bin", bytes);
    EXPECT_EQ(read_file(folder / "deep/er/file.bin"), bytes);
    write_file(folder / "deep/er/file.bin", "");
    EXPECT_EQ(read_file(folder / "deep/er/file.bin"), "");
    EXPECT_EQ(entries(folder / "deep/er"), 1u);
}

TEST(Files, AFailedWriteLeavesTheOldFileAndNothingElse) {
    const TempFolder folder;
    write_file(folder / "file.txt", "old");
    const auto action = [&] {
        write_atomically(folder / "file.txt", [](const fs::path& temporary) {
            EXPECT_EQ(temporary.extension(), ".txt");
            std::ofstream(temporary) << "half";
            throw Failure("disk full");
        });
    };
    EXPECT_EQ(message_of<Failure>(action), "disk full");
    EXPECT_EQ(read_file(folder / "file.txt"), "old");
    EXPECT_EQ(entries(folder.path()), 1u);
}

TEST(Files, MissingFilesAndFoldersAreInputErrors) {
    const TempFolder folder;
    EXPECT_CONTAINS(message_of<InputError>([&] { read_file(folder / "none"); }), "No such file");
    EXPECT_CONTAINS(message_of<InputError>([&] { read_file(folder.path()); }), "folder");
    EXPECT_CONTAINS(message_of<InputError>([&] { write_file(folder.path(), "x"); }), "in the way");
}

TEST(JsonFiles, RoundTripAndByteOrderMark) {
    const TempFolder folder;
    const Json value = {{"a", {1, 2.5, "ü"}}, {"b", nullptr}};
    write_json(folder / "a.json", value);
    EXPECT_EQ(read_json(folder / "a.json"), value);
    write_file(folder / "bom.json", "\xEF\xBB\xBF{\"a\": 1}");
    EXPECT_EQ(read_json(folder / "bom.json")["a"], 1);
}

TEST(JsonFiles, ErrorsNameLineAndColumn) {
    const TempFolder folder;
    write_file(folder / "bad.json", "{\n  \"a\": 1,\n  \"b\": oops\n}");
    const std::string text = message_of<InputError>([&] { read_json(folder / "bad.json"); });
    EXPECT_CONTAINS(text, "bad.json");
    EXPECT_CONTAINS(text, "line 3, column 8");
    write_file(folder / "nan.json", "{\"a\": [1.0, NaN]}");
    EXPECT_CONTAINS(message_of<InputError>([&] { read_json(folder / "nan.json"); }), "NaN");
    write_file(folder / "cut.json", "{\"a\": [1.0");
    message_of<InputError>([&] { read_json(folder / "cut.json"); });
    write_file(folder / "empty.json", "");
    message_of<InputError>([&] { read_json(folder / "empty.json"); });
}

}  // namespace
}  // namespace fieldgraft
