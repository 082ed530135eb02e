// What each benchmark program defines; perf/bench_main.cpp calls it once, before any runs. Cases
// are registered by hand, because some exist only where the real DEMs are.
#pragma once

namespace qmpipe::perf {

void register_benchmarks();

}  // namespace qmpipe::perf
