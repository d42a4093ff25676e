#include "core/base/process.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

namespace fieldgraft {

void keep_freed_memory() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 1 << 30);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
#endif
}

double peak_mib() {
    constexpr double kib = 1.0 / 1024;
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
        if (line.rfind("VmHWM:", 0) == 0) return kib * std::stod(line.substr(6));
    }
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return kib * static_cast<double>(usage.ru_maxrss);
}

std::string machine_name() {
    std::ifstream cpu("/proc/cpuinfo");
    for (std::string line; std::getline(cpu, line);) {
        const auto colon = line.find(": ");
        if (line.rfind("model name", 0) == 0 && colon != std::string::npos) return line.substr(colon + 2);
    }
    return "unknown";
}

int process_id() {
    return getpid();
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
