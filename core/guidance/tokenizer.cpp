#include "core/guidance/tokenizer.h"

#include <unicode/locid.h>
#include <unicode/normalizer2.h>
#include <unicode/uchar.h>
#include <unicode/unistr.h>
#include <unicode/utf8.h>

#include <algorithm>
#include <array>
#include <queue>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/base/json.h"

namespace fieldgraft {
namespace {

constexpr std::string_view begin_text = "<|startoftext|>";
constexpr std::string_view end_text = "<|endoftext|>";
constexpr std::string_view word_end = "</w>";

std::string to_utf8(char32_t c) {
    std::string out;
    icu::UnicodeString(static_cast<UChar32>(c)).toUTF8String(out);
    return out;
}

// The printable stand-in of each byte: itself where Latin-1 prints it, otherwise the next free code point from 256 on.
std::array<std::string, 256> byte_characters() {
    std::array<std::string, 256> out;
    char32_t next = 256;
    for (int byte = 0; byte < 256; ++byte) {
        const bool prints = (byte >= 33 && byte <= 126) || (byte >= 161 && byte <= 172) || byte >= 174;
        out[byte] = to_utf8(prints ? static_cast<char32_t>(byte) : next++);
    }
    return out;
}

void check_utf8(std::string_view text) {
    const auto length = static_cast<std::int64_t>(text.size());
    for (std::int64_t i = 0; i < length;) {
        UChar32 c = 0;
        const std::int64_t at = i;
        U8_NEXT(text.data(), i, length, c);
        if (c < 0) input_error("text is not UTF-8 at byte {} (0x{:02x})", at, static_cast<unsigned char>(text[at]));
    }
}

// NFC, white space runs to one blank, lower case of each code point by itself (so no final-sigma rule).
std::u32string normalise(std::string_view text) {
    check_utf8(text);
    UErrorCode status = U_ZERO_ERROR;
    const icu::Normalizer2* nfc = icu::Normalizer2::getNFCInstance(status);
    const auto source = icu::UnicodeString::fromUTF8({text.data(), static_cast<std::int32_t>(text.size())});
    const icu::UnicodeString composed = nfc ? nfc->normalize(source, status) : source;
    if (U_FAILURE(status)) failure("Unicode normalisation failed: {}", u_errorName(status));
    std::u32string out;
    for (std::int32_t i = 0; i < composed.length(); i = composed.moveIndex32(i, 1)) {
        const UChar32 c = composed.char32At(i);
        if (u_isUWhiteSpace(c)) {
            if (out.empty() || out.back() != U' ') out.push_back(U' ');
            continue;
        }
        icu::UnicodeString one(c);
        one.toLower(icu::Locale::getRoot());
        for (std::int32_t k = 0; k < one.length(); k = one.moveIndex32(k, 1)) out.push_back(one.char32At(k));
    }
    return out;
}

bool is_letter(char32_t c) {
    return (U_GET_GC_MASK(static_cast<UChar32>(c)) & U_GC_L_MASK) != 0;
}
bool is_number(char32_t c) {
    return (U_GET_GC_MASK(static_cast<UChar32>(c)) & U_GC_N_MASK) != 0;
}
bool is_other(char32_t c) {
    return !is_letter(c) && !is_number(c) && !u_isUWhiteSpace(static_cast<UChar32>(c));
}

// Length of the piece that starts at i (never 0), or of the blank there.
std::size_t piece_length(std::u32string_view text, std::size_t i) {
    const std::u32string_view rest = text.substr(i);
    for (const std::u32string_view suffix : {U"'s", U"'t", U"'re", U"'ve", U"'m", U"'ll", U"'d"})
        if (rest.starts_with(suffix)) return suffix.size();
    if (is_number(rest[0])) return 1;
    const auto same_kind = is_letter(rest[0]) ? is_letter : is_other;
    std::size_t length = 1;
    while (same_kind(rest[0]) && length < rest.size() && same_kind(rest[length])) ++length;
    return length;
}

struct Piece {
    std::u32string text;
    bool letters;
};

std::vector<Piece> split(std::string_view text) {
    const std::u32string clean = normalise(text);
    std::vector<Piece> out;
    for (std::size_t i = 0; i < clean.size();) {
        // A special token in other than its own spelling is split like any word, but its brackets stay apart from
        // neighbours.
        bool special = false;
        for (const std::u32string_view name : {U"startoftext", U"endoftext"}) {
            const std::u32string whole = U"<|" + std::u32string(name) + U"|>";
            if (!std::u32string_view(clean).substr(i).starts_with(whole)) continue;
            out.insert(out.end(), {{U"<|", false}, {std::u32string(name), true}, {U"|>", false}});
            i += whole.size();
            special = true;
            break;
        }
        if (special) continue;
        const std::size_t length = piece_length(clean, i);
        if (!u_isUWhiteSpace(static_cast<UChar32>(clean[i])))
            out.push_back({clean.substr(i, length), is_letter(clean[i])});
        i += length;
    }
    return out;
}

std::string to_utf8(const std::u32string& text) {
    std::string out;
    for (const char32_t c : text) out += to_utf8(c);
    return out;
}

Tokenizer::Merges read_merges(const std::filesystem::path& path) {
    Tokenizer::Merges out;
    const std::string text = read_file(path);
    std::size_t number = 0;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t stop = std::min(text.find('\n', at), text.size());
        std::string line = text.substr(at, stop - at);
        at = stop + 1;
        ++number;
        if (line.ends_with('\r')) line.pop_back();
        if (line.empty() || line.starts_with("#version")) continue;
        const std::size_t blank = line.find(' ');
        if (blank == std::string::npos || blank == 0 || blank + 1 == line.size())
            input_error("{}: line {}: '{}' is not two symbols with a blank between", path.string(), number, line);
        out.emplace_back(line.substr(0, blank), line.substr(blank + 1));
    }
    return out;
}

Tokenizer::Vocabulary read_vocabulary(const Json& json, const std::string& origin) {
    if (!json.is_object()) input_error("{}: a vocabulary is an object of token: id", origin);
    Tokenizer::Vocabulary out;
    for (const auto& [token, id] : json.items()) {
        if (!id.is_number_integer() || id.get<std::int64_t>() < 0)
            input_error("{}: the id of '{}' must be an integer from 0 on, not {}", origin, token, id.dump());
        out.emplace(token, id.get<std::int64_t>());
    }
    return out;
}

Tokenizer read_tokenizer_json(const std::filesystem::path& path) {
    const Json json = read_json(path);
    if (!json.contains("model") || !json["model"].contains("vocab") || !json["model"].contains("merges"))
        input_error("{}: has no model.vocab and model.merges (byte-pair encoding)", path.string());
    Tokenizer::Merges merges;
    for (const Json& item : json["model"]["merges"]) {
        if (item.is_array() && item.size() == 2 && item[0].is_string() && item[1].is_string()) {
            merges.emplace_back(item[0].get<std::string>(), item[1].get<std::string>());
            continue;
        }
        const std::string line = item.is_string() ? item.get<std::string>() : "";
        const std::size_t blank = line.find(' ');
        if (blank == std::string::npos) input_error("{}: {} is not a merge", path.string(), item.dump());
        merges.emplace_back(line.substr(0, blank), line.substr(blank + 1));
    }
    return {read_vocabulary(json["model"]["vocab"], path.string()), merges};
}

std::uint64_t pair_key(std::int64_t left, std::int64_t right) {
    return (static_cast<std::uint64_t>(left) << 32) | static_cast<std::uint64_t>(right);
}

}  // namespace

Tokenizer Tokenizer::load(const std::filesystem::path& folder) {
    const auto vocabulary = folder / "vocab.json", merges = folder / "merges.txt", whole = folder / "tokenizer.json";
    if (std::filesystem::exists(vocabulary) && std::filesystem::exists(merges))
        return {read_vocabulary(read_json(vocabulary), vocabulary.string()), read_merges(merges)};
    if (std::filesystem::exists(whole)) return read_tokenizer_json(whole);
    input_error("{}: has neither vocab.json and merges.txt nor tokenizer.json", folder.string());
}

Tokenizer::Tokenizer(Vocabulary vocabulary, const Merges& merges) : vocabulary_(std::move(vocabulary)) {
    const auto special = [&](std::string_view name) {
        const auto found = vocabulary_.find(std::string(name));
        if (found == vocabulary_.end()) input_error("the vocabulary has no '{}'", name);
        return found->second;
    };
    begin_ = special(begin_text);
    end_ = special(end_text);
    for (const auto& [token, id] : vocabulary_) largest_ = std::max(largest_, id);
    if (largest_ > 0x7fffffff) input_error("the vocabulary has the id {}: more than 2147483647", largest_);

    // What the vocabulary lacks reads as the end token, CLIP's "unknown".
    const auto id_or_unknown = [&](const std::string& token) {
        const auto found = vocabulary_.find(token);
        return found == vocabulary_.end() ? end_ : found->second;
    };
    for (const std::string& character : byte_characters()) {
        byte_ids_.push_back(id_or_unknown(character));
        last_byte_ids_.push_back(id_or_unknown(character + std::string(word_end)));
    }
    std::uint32_t rank = 0;
    for (const auto& [left, right] : merges) {
        const auto a = vocabulary_.find(left), b = vocabulary_.find(right), both = vocabulary_.find(left + right);
        if (a == vocabulary_.end() || b == vocabulary_.end() || both == vocabulary_.end())
            input_error("the merge '{} {}' (number {}) has a part or result that is not in the vocabulary", left, right,
                        rank + 1);
        merges_[pair_key(a->second, b->second)] = {rank++, both->second};
    }
}

const Tokenizer::Merge* Tokenizer::find_merge(std::int64_t left, std::int64_t right) const {
    const auto found = merges_.find(pair_key(left, right));
    return found == merges_.end() ? nullptr : &found->second;
}

// A linked list of symbols and a queue of possible merges by (rank, position): O(n log n) even for one endless word.
std::vector<std::int64_t> Tokenizer::merge(std::vector<std::int64_t> symbols) const {
    struct Candidate {
        std::uint32_t rank;
        std::size_t at;
        std::int64_t left, right;
        bool operator>(const Candidate& other) const { return std::pair(rank, at) > std::pair(other.rank, other.at); }
    };
    const std::size_t count = symbols.size();
    std::vector<std::size_t> next(count), previous(count);
    std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
    const auto offer = [&](std::size_t at) {
        if (at >= count || next[at] >= count) return;
        if (const Merge* found = find_merge(symbols[at], symbols[next[at]]))
            queue.push({found->rank, at, symbols[at], symbols[next[at]]});
    };
    for (std::size_t i = 0; i < count; ++i) {
        next[i] = i + 1;
        previous[i] = i == 0 ? count : i - 1;
    }
    for (std::size_t i = 0; i < count; ++i) offer(i);
    while (!queue.empty()) {
        const Candidate top = queue.top();
        queue.pop();
        const std::size_t right = next[top.at];
        // Stale: one of the two symbols has been merged since.
        if (right >= count || symbols[top.at] != top.left || symbols[right] != top.right) continue;
        symbols[top.at] = find_merge(top.left, top.right)->id;
        symbols[right] = -1;
        next[top.at] = next[right];
        if (next[right] < count) previous[next[right]] = top.at;
        if (previous[top.at] < count) offer(previous[top.at]);
        offer(top.at);
    }
    std::erase(symbols, -1);
    return symbols;
}

void Tokenizer::encode_piece(const std::string& piece, std::vector<std::int64_t>& ids) const {
    std::vector<std::int64_t> symbols;
    symbols.reserve(piece.size());
    for (std::size_t i = 0; i < piece.size(); ++i) {
        const auto byte = static_cast<unsigned char>(piece[i]);
        symbols.push_back(i + 1 == piece.size() ? last_byte_ids_[byte] : byte_ids_[byte]);
    }
    for (const std::int64_t id : merge(std::move(symbols))) ids.push_back(id);
}

std::vector<std::int64_t> Tokenizer::encode(std::string_view text, std::size_t max_length) const {
    if (max_length == 1)
        throw std::invalid_argument("Tokenizer::encode: max_length 1 leaves no room for the end token");
    std::vector<std::int64_t> ids{begin_};
    while (!text.empty()) {
        const std::size_t begin_at = text.find(begin_text), end_at = text.find(end_text);
        const std::size_t stop = std::min({begin_at, end_at, text.size()});
        for (const Piece& piece : split(text.substr(0, stop))) encode_piece(to_utf8(piece.text), ids);
        if (stop == text.size()) break;
        ids.push_back(stop == begin_at ? begin_ : end_);
        text.remove_prefix(stop + (stop == begin_at ? begin_text.size() : end_text.size()));
    }
    ids.push_back(end_);
    if (max_length > 0 && ids.size() > max_length) {
        ids.resize(max_length);
        ids.back() = end_;
    }
    return ids;
}

std::vector<std::string> Tokenizer::pieces(std::string_view text) {
    std::vector<std::string> out;
    for (const Piece& piece : split(text)) out.push_back(to_utf8(piece.text));
    return out;
}

std::vector<std::string> Tokenizer::words(std::string_view text) {
    std::vector<std::string> out;
    for (const Piece& piece : split(text))
        if (piece.letters) out.push_back(to_utf8(piece.text));
    return out;
}

}  // namespace fieldgraft
