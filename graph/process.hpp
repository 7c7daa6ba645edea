// How the processes of a graph use the machine they share.
#pragma once

namespace cosegraph::graph {

// For the beginning of a program that works on one frame after the other, or looks on.
//
// What a frame frees stays with the process for the next one. Of itself the C library hands blocks
// above 128 kB back to the kernel, and gets them anew, page by page, with every frame (where it is
// GNU's). And a process that wakes up does not take the processor from one that works
// (SCHED_BATCH): there are more threads in a graph than processors, which each message would send
// from one to the other. What is refused, in a sandbox say, stays as it was.
void set_up_process();

// For who only looks on: where no processor is idle it works less often, and more at a time. It
// keeps the share that it needs; with much less, what it reads would wait and go lost.
void give_way();

}  // namespace cosegraph::graph
