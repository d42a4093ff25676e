// Questions about a rendered picture with the exact answer: a text and the pixels it speaks of (at least two of the
// pixel's four samples). Kinds as in a batch's "query_kinds". A thing is asked for as absent only if nothing in the
// scene, seen or hidden, could be called that.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "models/generator/compose.h"
#include "models/generator/settings.h"
#include "models/generator/sight.h"
#include "models/generator/spec.h"

namespace fieldgraft::generator {

enum class QueryKind : uint8_t { kObject, kPart, kGround, kAbsent, kAttribute, kPhoto, kAddition };
constexpr int kQueries = 6;

struct Query {
    std::string text;
    QueryKind kind = QueryKind::kPhoto;
    std::vector<uint8_t> mask;  // size x size, 0 or 1
};

// `filter` kTrain: combinations kept for the held-out split are not asked for as absent either, or training would teach
// that they never exist.
std::vector<Query> draw_queries(const SceneSpec& spec, const Sight& sight, const Settings& settings, Filter filter,
                                Rng rng);

}  // namespace fieldgraft::generator
