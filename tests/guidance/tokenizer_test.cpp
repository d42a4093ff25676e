#include "core/guidance/tokenizer.h"

#include <gtest/gtest.h>

#include "tests/guidance/tiny_model.h"

namespace fieldgraft {
namespace {

using Words = std::vector<std::string>;

Tokenizer tiny() {
    const TemporaryFolder folder;
    TinyModel().write(folder.path());
    return Tokenizer::load(folder.path());
}

TEST(Tokenizer, SplitsAsClipDoes) {
    EXPECT_EQ(Tokenizer::pieces("Don't  STOP\t\n now"), (Words{"don", "'t", "stop", "now"}));
    EXPECT_EQ(Tokenizer::pieces("it's 25 we'll I'd"), (Words{"it", "'s", "2", "5", "we", "'ll", "i", "'d"}));
    EXPECT_EQ(Tokenizer::pieces("wow!!'s (x)..."), (Words{"wow", "!!'", "s", "(", "x", ")..."}));
    EXPECT_EQ(Tokenizer::pieces("  "), Words{});
    EXPECT_EQ(Tokenizer::pieces("ÄÖ ß 東京 ½٣"), (Words{"äö", "ß", "東京", "½", "٣"}));
    // Decomposed accents are composed; the dotted capital I falls into two code points; sigma has no final form.
    EXPECT_EQ(Tokenizer::pieces("e\u0301"), Words{"\u00e9"});
    EXPECT_EQ(Tokenizer::pieces("\u0130"), (Words{"i", "\u0307"}));
    EXPECT_EQ(Tokenizer::pieces("ΟΔΟΣ"), Words{"οδοσ"});
    // No-break and ideographic spaces are spaces, zero-width ones are not.
    EXPECT_EQ(Tokenizer::pieces("a\u00a0b\u3000c\u200bd"), (Words{"a", "b", "c", "\u200b", "d"}));
    EXPECT_EQ(Tokenizer::pieces("<|StartOfText|>x"), (Words{"<|", "startoftext", "|>", "x"}));
    EXPECT_EQ(Tokenizer::words("2 red-hot balls!"), (Words{"red", "hot", "balls"}));
}

TEST(Tokenizer, MergesByRankAndKeepsTheEnds) {
    const Tokenizer tokenizer = tiny();
    const TinyModel model;
    const auto id = [&](const char* token) { return model.vocabulary.at(token).get<std::int64_t>(); };
    const std::int64_t begin = id("<|startoftext|>"), end = id("<|endoftext|>");
    EXPECT_EQ(tokenizer.encode("red ball"), (std::vector{begin, id("red</w>"), id("ball</w>"), end}));
    EXPECT_EQ(tokenizer.encode("balls"), (std::vector{begin, id("bal"), id("l"), id("s</w>"), end}));
    EXPECT_EQ(tokenizer.encode("RED"), tokenizer.encode("red"));
    EXPECT_EQ(tokenizer.encode(""), (std::vector{begin, end}));
    EXPECT_EQ(tokenizer.encode("red<|endoftext|>red"), (std::vector{begin, id("red</w>"), end, id("red</w>"), end}));
    EXPECT_EQ(tokenizer.encode("red red red red", 4), (std::vector{begin, id("red</w>"), id("red</w>"), end}));
    // A byte the vocabulary lacks is the unknown token, once a byte.
    EXPECT_EQ(tokenizer.encode("é"), (std::vector{begin, end, end, end}));
    EXPECT_THROW(tokenizer.encode("red", 1), std::invalid_argument);
}

TEST(Tokenizer, OverlappingMergesGoLeftToRight) {
    Tokenizer::Vocabulary vocabulary{{"a", 0},       {"a</w>", 1},           {"aa", 2},           {"aaaa", 3},
                                     {"aaa</w>", 4}, {"<|startoftext|>", 5}, {"<|endoftext|>", 6}};
    const Tokenizer tokenizer(vocabulary, {{"a", "a"}, {"aa", "aa"}, {"aa", "a</w>"}});
    EXPECT_EQ(tokenizer.encode("aaa"), (std::vector<std::int64_t>{5, 4, 6}));
    EXPECT_EQ(tokenizer.encode("aaaa"), (std::vector<std::int64_t>{5, 2, 0, 1, 6}));
    EXPECT_EQ(tokenizer.encode("aaaaaa"), (std::vector<std::int64_t>{5, 3, 0, 1, 6}));
}

TEST(Tokenizer, OneEndlessWordIsFast) {
    const Tokenizer tokenizer = tiny();
    std::string word;
    for (int i = 0; i < 100000; ++i) word += "red";
    EXPECT_EQ(tokenizer.encode(word, 10).size(), 10u);
    // "re" merges everywhere, "red</w>" only at the end.
    EXPECT_EQ(tokenizer.encode(word, 0).size(), 2u * 100000 - 1 + 2);
}

TEST(Tokenizer, BadInputIsNamed) {
    const Tokenizer tokenizer = tiny();
    EXPECT_EQ(message_of<InputError>([&] { tokenizer.encode("ab\xff"); }), "text is not UTF-8 at byte 2 (0xff)");
    const TemporaryFolder folder;
    EXPECT_NE(message_of<InputError>([&] { Tokenizer::load(folder.path()); }).find("neither vocab.json"),
              std::string::npos);
    TinyModel model;
    model.merges = "r e\nred\n";
    model.write(folder.path());
    EXPECT_NE(message_of<InputError>([&] { Tokenizer::load(folder.path()); }).find("merges.txt: line 2: 'red'"),
              std::string::npos);
    model.merges = "r q\n";
    model.write(folder.path());
    EXPECT_NE(message_of<InputError>([&] { Tokenizer::load(folder.path()); }).find("'r q' (number 1)"),
              std::string::npos);
    EXPECT_NE(message_of<InputError>([&] { Tokenizer({{"a", 0}}, {}); }).find("<|startoftext|>"), std::string::npos);
}

TEST(Tokenizer, ReadsTokenizerJsonToo) {
    const TemporaryFolder folder;
    const TinyModel model;
    write_json(
        folder.path() / "tokenizer.json",
        {{"model",
          {{"vocab", model.vocabulary}, {"merges", {"r e", "re d</w>", {"b", "a"}, {"ba", "l"}, "bal l</w>"}}}}});
    EXPECT_EQ(Tokenizer::load(folder.path()).encode("red ball re"), tiny().encode("red ball re"));
}

}  // namespace
}  // namespace fieldgraft
