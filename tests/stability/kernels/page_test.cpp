// docs/stability.md promises what the code promises, line by line.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/stability/ledger.h"

namespace fieldgraft::stability {
namespace {

std::vector<std::string> cells_of(const std::string& line) {
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, '|');) {
        const auto first = cell.find_first_not_of(' '), last = cell.find_last_not_of(' ');
        cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
    }
    return cells;
}

TEST(Page, PromisesWhatTheCodePromises) {
    std::ifstream page(std::string(FIELDGRAFT_SOURCE_DIR) + "/docs/stability.md");
    ASSERT_TRUE(page.good());
    std::map<std::string, int> said;
    bool inside = false;
    for (std::string line; std::getline(page, line);) {
        if (line == "<!-- figures: stability -->") inside = true;
        if (line == "<!-- end -->") inside = false;
        const std::vector<std::string> cells = cells_of(line);
        if (!inside || cells.size() < 10 || cells[1] == "quantity" || cells[1] == "---") continue;
        SCOPED_TRACE(line);
        ++said[cells[1] + "|" + cells[2] + "|" + cells[3]];
        const Promise& made = promise(cells[1], cells[2], cells[3]);  // throws for what the code does not promise
        char bound[32];
        std::snprintf(bound, sizeof bound, "%.1e", made.bound);
        EXPECT_EQ(cells[7], bound);
        EXPECT_EQ(cells[9], made.unit);
        EXPECT_LE(std::stod(cells[6]), made.bound);
    }
    for (const Promise& made : promises()) {
        if (made.path == "bfloat16") continue;  // a machine without the tiles has no figure for the page
        EXPECT_EQ(said[made.quantity + "|" + made.part + "|" + made.path], 1)
            << made.quantity << ", " << made.part << ", " << made.path;
    }
}

}  // namespace
}  // namespace fieldgraft::stability
