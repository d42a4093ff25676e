// Runs a test's body on every instruction set that was compiled and that this machine has.
#pragma once

#include <gtest/gtest.h>

#include <hwy/targets.h>

namespace fieldgraft::testing {

template <class Body>
void on_every_target(Body body) {
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        SCOPED_TRACE(hwy::TargetName(target));
        body();
    }
    hwy::SetSupportedTargetsForTest(0);
}

}  // namespace fieldgraft::testing
