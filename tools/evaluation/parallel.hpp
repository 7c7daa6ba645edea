// Independent pieces of work on several threads.
#pragma once

#include <cstddef>
#include <functional>

namespace cosegraph::evaluation {

// Calls body(0), ..., body(count - 1), each once, in that order of starting, on `jobs` threads
// (at least 1). Before each piece `stopped` is asked (empty: never); once it says yes no further
// piece is started and the answer is false. An exception out of `body` or `stopped` ends the work
// alike and is thrown again here.
bool parallel_for(std::size_t count, int jobs, const std::function<bool()>& stopped,
                  const std::function<void(std::size_t)>& body);

}  // namespace cosegraph::evaluation
