// How long RapidCheck looks for a counterexample; RC_PARAMS says otherwise.
#include <gtest/gtest.h>

#include <cstdlib>

namespace {

class Search : public ::testing::Environment {
  public:
    void SetUp() override { setenv("RC_PARAMS", "max_success=400", 0); }
};
[[maybe_unused]] const ::testing::Environment* const search = ::testing::AddGlobalTestEnvironment(new Search);

}  // namespace
