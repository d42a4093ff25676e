// How the program talks: progress on a terminal, or one JSON object a line with --json; Ctrl-C; exit codes.
//
//   0  success      1  the work failed      2  bad usage or bad input (one line: what, where, what would be right)
//   130  cancelled by Ctrl-C, after what was finished has been saved
//
// With --json the events go to standard output and nothing else does; people's output goes to standard error, except
// the figures a command ends with.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "core/base/progress.h"

namespace fieldgraft::app {

struct CommonOptions {
    bool json = false;
    bool quiet = false;
    int threads = 0;  // 0: every core
    std::string device = "cpu";
    std::uint64_t seed = 0;
};

// A subcommand registers its options on `parent` and sets `action`, which main() runs after parsing.
struct Program {
    CLI::App cli{"Fieldgraft: text-driven, localised editing of neural radiance fields", "fieldgraft"};
    CommonOptions common;
    std::function<void()> action;

    CLI::App* command(const std::string& name, const std::string& description);
};

// The reporter a command hands to the library: draws or prints events, and stops on Ctrl-C.
Reporter console_reporter(const CommonOptions& common, const std::string& label);
// {"event": "done", …}: printed as JSON, or as a short table for people.
void print_done(const CommonOptions& common, Json figures);
// Thread pool, device checks. Throws InputError for a device that is not there.
void apply_common(const CommonOptions& common);
// Runs the action and maps what it throws to the exit code, printing one line.
int run_and_report(const CommonOptions& common, const std::function<void()>& action);

void add_train(Program& program);
void add_edit(Program& program);
void add_render(Program& program);
void add_eval(Program& program);
void add_bake(Program& program);
void add_profile(Program& program);
void add_info(Program& program);

}  // namespace fieldgraft::app
