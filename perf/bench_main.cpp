#include <benchmark/benchmark.h>

#include <cstdio>
#include <exception>

#include "perf/register_benchmarks.h"

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  try {
    qmpipe::perf::register_benchmarks();
    benchmark::RunSpecifiedBenchmarks();
    // They own files, which should go before the program ends.
    benchmark::ClearRegisteredBenchmarks();
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "benchmark: %s\n", error.what());
    return 1;
  }
}
