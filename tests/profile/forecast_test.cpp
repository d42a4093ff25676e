#include "core/profile/forecast.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fieldgraft {
namespace {

constexpr double probe_minutes = Forecast::probe_seconds / 60;

TEST(Forecast, BeginsWhereTheProbeEndsAndRises) {
    const Forecast forecast(29);
    EXPECT_NEAR(forecast.psnr_after(probe_minutes), 29, 1e-9);
    double before = 29;
    for (const double minutes : {0.5, 1.0, 3.0, 10.0, 60.0}) {
        EXPECT_GT(forecast.psnr_after(minutes), before);
        before = forecast.psnr_after(minutes);
    }
    EXPECT_LT(Forecast(37).psnr_after(10) - 37, forecast.psnr_after(10) - 29) << "what is sharp has less to gain";
    EXPECT_EQ(Forecast(50).psnr_after(10), 50);
}

TEST(Forecast, TimeAndPsnrAreEachOthersInverse) {
    const Forecast forecast(30);
    for (const double minutes : {0.4, 2.0, 20.0}) {
        const auto told = forecast.minutes_for(forecast.psnr_after(minutes));
        ASSERT_TRUE(told);
        EXPECT_NEAR(*told, minutes, 1e-9 * minutes);
    }
    EXPECT_NEAR(*forecast.minutes_for(12), probe_minutes, 1e-12) << "never less than the probe";
    EXPECT_FALSE(forecast.minutes_for(forecast.psnr_after(60) + 0.01)) << "more than an hour";
    EXPECT_FALSE(Forecast(50).minutes_for(50.5));
}

TEST(Forecast, RefusesWhatIsNoPsnr) {
    EXPECT_THROW(Forecast(std::nan("")), std::invalid_argument);
    EXPECT_THROW(Forecast(30).psnr_after(0.1), std::invalid_argument);
    EXPECT_THROW(Forecast(30).psnr_after(std::nan("")), std::invalid_argument);
}

}  // namespace
}  // namespace fieldgraft
