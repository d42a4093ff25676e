#include "core/profile/machine_rates.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "core/base/files.h"
#include "core/base/process.h"
#include "core/base/torch.h"

namespace fieldgraft {
namespace {

HashFieldConfig field_of(int log2_table, int width) {
    HashFieldConfig field;
    field.log2_table_size = log2_table;
    field.density_hidden = field.color_hidden = width;
    return field;
}

TEST(WorkRate, GoesThroughItsThreeMeasurements) {
    const std::array<MeasuredRate, 3> measured{
        {{field_of(16, 32), 400}, {field_of(18, 32), 460}, {field_of(18, 64), 640}}};
    const WorkRate rate = rate_through(measured);
    for (const MeasuredRate& m : measured) EXPECT_NEAR(rate.of(m.field), m.ns, 1e-9);
    EXPECT_NEAR(rate.of(field_of(17, 32)), 430, 1e-9);
    EXPECT_NEAR(rate.of(field_of(14, 32)), 400, 1e-9) << "smaller tables are in the cache, too";
    EXPECT_GT(rate.of(field_of(16, 128)), rate.of(field_of(16, 64)));
}

TEST(WorkRate, NoiseMakesNothingFree) {
    const WorkRate rate = rate_through({{{field_of(16, 32), 400}, {field_of(18, 32), 390}, {field_of(18, 64), 380}}});
    EXPECT_EQ(rate.table, 0);
    EXPECT_EQ(rate.product, 0);
    EXPECT_EQ(rate.of(field_of(19, 128)), 400);
}

class MachineFile : public ::testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::temp_directory_path() / fmt::format("fieldgraft_machine_{}", process_id());
        if (const char* before = std::getenv("XDG_CACHE_HOME")) before_ = before;
        setenv("XDG_CACHE_HOME", folder_.c_str(), 1);
    }
    void TearDown() override {
        std::filesystem::remove_all(folder_);
        before_ ? setenv("XDG_CACHE_HOME", before_->c_str(), 1) : unsetenv("XDG_CACHE_HOME");
    }
    MachineRates rates() const {
        const WorkRate rate{100, 0.05, 7};
        return {machine_name(), at::get_num_threads(), rate, rate, {50, 0.01, 0}, 300, 2e8};
    }
    std::filesystem::path folder_;
    std::optional<std::string> before_;
};

TEST_F(MachineFile, IsReadOnTheMachineThatItIsOf) {
    EXPECT_FALSE(load_rates()) << "nothing measured yet";
    save_rates(rates());
    ASSERT_TRUE(load_rates());
    EXPECT_EQ(load_rates()->to_json(), rates().to_json());
    MachineRates other = rates();
    other.machine = "another processor";
    save_rates(other);
    EXPECT_FALSE(load_rates());
    other = rates();
    ++other.threads;
    save_rates(other);
    EXPECT_FALSE(load_rates());
}

TEST_F(MachineFile, ThatIsBrokenIsNone) {
    write_file(machine_file(), "{\"machine\": ");
    EXPECT_FALSE(load_rates());
    write_file(machine_file(), "[]");
    EXPECT_FALSE(load_rates());
}

}  // namespace
}  // namespace fieldgraft
