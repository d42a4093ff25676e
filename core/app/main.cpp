// fieldgraft: parses the command line, runs one subcommand, maps its outcome to an exit code.
#include <cstdio>

#include "core/app/console.h"
#include "core/base/process.h"

int main(int argc, char** argv) {
    using namespace fieldgraft::app;
    fieldgraft::bound_waiting(argv);
    Program program;
    program.cli.require_subcommand(1);
    program.cli.set_version_flag("--version", "fieldgraft 0.1.0");
    for (auto add : {add_train, add_edit, add_render, add_eval, add_bake, add_profile, add_info}) add(program);
    try {
        program.cli.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        // Help and version are successes; everything else is one line and bad usage.
        if (error.get_exit_code() == 0) return program.cli.exit(error);
        std::fprintf(stderr, "fieldgraft: %s (see fieldgraft --help)\n", error.what());
        return 2;
    }
    fieldgraft::keep_freed_memory();
    return run_and_report(program.common, program.action);
}
