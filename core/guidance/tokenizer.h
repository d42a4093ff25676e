// CLIP's tokenizer: byte-level byte-pair encoding with an end-of-word mark (Radford et al. 2021, "Learning Transferable
// Visual Models From Natural Language Supervision", section 2.4; Sennrich et al. 2016). Text → token ids.
//
//   1. "<|startoftext|>" and "<|endoftext|>" in the text become their own ids;
//   2. Unicode NFC, every run of white space to one blank, lower case (code point by code point);
//   3. pieces: 's|'t|'re|'ve|'m|'ll|'d | letters+ | one number character | (neither space, letter nor number)+;
//   4. a piece's UTF-8 bytes to 256 printable characters, the last one marked "</w>", then merges in order of rank
//      (the leftmost first among equals).
// Ids and order are exactly those of transformers' CLIPTokenizer (tests/guidance/test_parity.py). Unicode tables: ICU.
// Text that is not UTF-8 is an InputError. Thread-safe: nothing changes after construction.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace fieldgraft {

class Tokenizer {
  public:
    using Vocabulary = std::unordered_map<std::string, std::int64_t>;
    using Merges = std::vector<std::pair<std::string, std::string>>;

    // From vocab.json and merges.txt in the folder, or from a tokenizer.json. Throws InputError.
    static Tokenizer load(const std::filesystem::path& folder);
    Tokenizer(Vocabulary vocabulary, const Merges& merges);

    // Begin token, text, end token; cut to max_length ids with the end token kept. max_length ≥ 2; 0: no limit.
    std::vector<std::int64_t> encode(std::string_view text, std::size_t max_length = 77) const;
    // The text after steps 2 and 3, each piece in UTF-8 ("Don't  STOP" → don, 't, stop).
    static std::vector<std::string> pieces(std::string_view text);
    // Only the pieces made of letters.
    static std::vector<std::string> words(std::string_view text);

    std::int64_t begin_id() const { return begin_; }
    std::int64_t end_id() const { return end_; }
    std::int64_t largest_id() const { return largest_; }

  private:
    struct Merge {
        std::uint32_t rank;
        std::int64_t id;
    };
    void encode_piece(const std::string& piece, std::vector<std::int64_t>& ids) const;
    std::vector<std::int64_t> merge(std::vector<std::int64_t> symbols) const;
    const Merge* find_merge(std::int64_t left, std::int64_t right) const;

    Vocabulary vocabulary_;
    std::unordered_map<std::uint64_t, Merge> merges_;
    std::int64_t begin_ = 0, end_ = 0, largest_ = 0;
    std::vector<std::int64_t> byte_ids_, last_byte_ids_;  // of each byte, inside a word and at its end
};

}  // namespace fieldgraft
