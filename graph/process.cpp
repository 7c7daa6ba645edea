#include "graph/process.hpp"

#include <malloc.h>
#include <sched.h>
#include <unistd.h>

namespace cosegraph::graph {

void set_up_process() {
#ifdef __GLIBC__
  constexpr int kLargestOfTheHeap = 32 << 20;  // bytes; the most that the library takes
  constexpr int kKeptAtMost = 64 << 20;
  ::mallopt(M_MMAP_THRESHOLD, kLargestOfTheHeap);
  ::mallopt(M_TRIM_THRESHOLD, kKeptAtMost);
#endif
  const sched_param none{};
  ::sched_setscheduler(0, SCHED_BATCH, &none);
}

void give_way() {
  constexpr int kNicer = 4;  // a weight of .41
  static_cast<void>(::nice(kNicer));
}

}  // namespace cosegraph::graph
