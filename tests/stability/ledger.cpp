#include "tests/stability/ledger.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace fieldgraft::stability {

namespace {

// JSON knows no Inf.
nlohmann::json number(double value) {
    return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json("not finite");
}

// Writes the ledger once all tests have run.
class Writer : public ::testing::Environment {
  public:
    void TearDown() override {
        if (const char* path = std::getenv("FIELDGRAFT_STABILITY_OUT")) ledger().write(path);
    }
};
[[maybe_unused]] const ::testing::Environment* const writer = ::testing::AddGlobalTestEnvironment(new Writer);

}  // namespace

const Promise& promise(const std::string& quantity, const std::string& part, const std::string& path) {
    for (const Promise& p : promises()) {
        if (p.quantity == quantity && p.part == part && p.path == path) return p;
    }
    throw std::logic_error("nothing is promised for " + quantity + ", " + part + ", " + path);
}

Ledger& ledger() {
    static Ledger one;
    return one;
}

void Ledger::add(const std::string& quantity, const std::string& part, const std::string& path,
                 const std::string& input, double ours, double naive) {
    const auto [place, fresh] = rows_.try_emplace({quantity, part, path, input});
    Row& row = place->second;
    if (fresh) row.bound = promise(quantity, part, path).bound;
    row.ours = std::max(row.ours, ours);
    if (std::isfinite(naive)) {
        row.naive = std::max(row.naive, naive);
    } else {
        ++row.naive_lost;
    }
    ++row.cases;
    EXPECT_LE(ours, row.bound) << quantity << ", " << part << ", " << path << ", " << input;
}

void Ledger::write(const std::string& path) const {
    nlohmann::json rows = nlohmann::json::array();
    for (const Promise& made : promises()) {
        for (const auto& [key, row] : rows_) {
            if (key[0] != made.quantity || key[1] != made.part || key[2] != made.path) continue;
            nlohmann::json json{{"quantity", key[0]}, {"part", key[1]},     {"path", key[2]},
                                {"input", key[3]},    {"cases", row.cases}, {"ours", number(row.ours)},
                                {"bound", row.bound}, {"unit", made.unit}};
            if (row.naive >= 0) json["naive"] = row.naive;
            if (row.naive_lost > 0) json["naive_lost"] = row.naive_lost;
            rows.push_back(json);
        }
    }
    std::ofstream(path) << rows.dump(1) << '\n';
}

}  // namespace fieldgraft::stability
