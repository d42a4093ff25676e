#include "core/base/process.h"

#include <malloc.h>
#include <unistd.h>

#include <cstdlib>

namespace fieldgraft {

void keep_freed_memory() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 1 << 30);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
#endif
}

void bound_waiting(char** argv) {
#ifdef __linux__
    constexpr const char *spins = "GOMP_SPINCOUNT", *policy = "OMP_WAIT_POLICY";
    if (std::getenv(spins) != nullptr || std::getenv(policy) != nullptr) return;
    if (setenv(spins, "2000", 1) != 0) return;
    execv("/proc/self/exe", argv);  // returns only if it fails: then we go on as we are
#endif
}

}  // namespace fieldgraft
