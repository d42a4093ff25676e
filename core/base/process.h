// How the process treats memory it has freed, and threads that wait; how much memory it has held.
#pragma once

#include <string>

namespace fieldgraft {

// From now on freed blocks stay with the process. Every training step and every view needs the same large blocks again;
// handing them back to the system in between costs a tenth of the time in page faults.
void keep_freed_memory();

// The most that this program has held at once, MiB. Not getrusage's: that of a child begins with its parent's.
double peak_mib();

// The processor's name as the system gives it; "unknown".
std::string machine_name();
int process_id();

// Lets OpenMP's threads wait for each other busily for a moment only, then asleep. Its default keeps a core busy for
// milliseconds at each of the thousands of times a second that threads meet; on a machine that does something else, too
// (Blender draws its viewport), most of that is spent on waiting for a thread that cannot run. OpenMP reads its
// settings before main(): so the program starts itself once more, unless the user has said how to wait (GOMP_SPINCOUNT
// or OMP_WAIT_POLICY). Call it first; argv as main() has it.
void bound_waiting(char** argv);

}  // namespace fieldgraft
