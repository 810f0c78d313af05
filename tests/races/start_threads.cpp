// Purpose: OpenMP regions of GCC on std::thread, whose start and join ThreadSanitizer knows: the few functions that the
// compiler calls for "parallel", "parallel for schedule(static, 1)" and "master", in place of libgomp.
#include <thread>
#include <vector>

namespace {
thread_local int number = 0, team_size = 1;
}

extern "C" {

int omp_get_thread_num() { return number; }
int omp_get_num_threads() { return team_size; }

void GOMP_parallel(void (*body)(void*), void* data, unsigned threads, unsigned /*flags*/) {
  const int outer_number = number, outer_size = team_size;
  const auto take = [&](int own) {
    number = own;
    team_size = static_cast<int>(threads);
    body(data);
  };
  std::vector<std::thread> others;
  for (unsigned t = 1; t < threads; ++t) others.emplace_back(take, static_cast<int>(t));
  take(0);
  for (std::thread& thread : others) thread.join();
  number = outer_number;
  team_size = outer_size;
}
}
