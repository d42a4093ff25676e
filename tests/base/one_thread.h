// A fixture for tests that compare bits: sums over many threads differ in the last ones.
#pragma once

#include <gtest/gtest.h>

#include "core/base/torch.h"

namespace fieldgraft {

class OneThread : public ::testing::Test {
  protected:
    void SetUp() override {
        threads_ = at::get_num_threads();
        at::set_num_threads(1);
    }
    void TearDown() override { at::set_num_threads(threads_); }

  private:
    int threads_ = 1;
};

}  // namespace fieldgraft
