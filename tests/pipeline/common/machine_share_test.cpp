#include "pipeline/common/machine_share.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <fstream>
#include <string>
#include <thread>

#include "pipeline/common/process_memory.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::testing::machine_share_test {
namespace {

namespace fs = std::filesystem;

class Cgroups : public ::testing::Test {
 protected:
  void write(const std::string& file, const std::string& text) const {
    const fs::path path = folder_.path() / file;
    fs::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  CgroupLimits limits() const {
    return cgroup_limits(folder_.path() / "cgroup", folder_.path() / "fs");
  }
  void expect(std::optional<double> processors, std::optional<std::int64_t> memory_bytes) const {
    EXPECT_EQ(limits().processors, processors);
    EXPECT_EQ(limits().memory_bytes, memory_bytes);
  }

  TemporaryFolder folder_;
};

TEST_F(Cgroups, NothingLimitsWhereThereIsNone) {
  expect(std::nullopt, std::nullopt);
  write("cgroup", "0::/\n");
  expect(std::nullopt, std::nullopt);
}

TEST_F(Cgroups, TheLeastOfAGroupAndThoseAboveIt) {
  write("cgroup", "0::/user.slice/job/step\n");
  write("fs/user.slice/cpu.max", "800000 100000\n");
  write("fs/user.slice/memory.max", "4294967296\n");
  write("fs/user.slice/job/cpu.max", "150000 100000\n");
  write("fs/user.slice/job/memory.max", "max\n");
  write("fs/user.slice/job/step/cpu.max", "max 100000\n");
  write("fs/user.slice/job/step/memory.max", "8589934592\n");
  // Another one's.
  write("fs/other/memory.max", "4096\n");
  expect(1.5, std::int64_t{4} << 30);
}

TEST_F(Cgroups, AContainerSeesItsOwnGroupAsTheRoot) {
  write("cgroup", "0::/\n");
  write("fs/cpu.max", "200000 100000\n");
  write("fs/memory.max", "536870912\n");
  expect(2, 512 << 20);
  // And may be told of a place that lies outside.
  write("cgroup", "0::/../../host\n");
  expect(2, 512 << 20);
}

TEST_F(Cgroups, VersionOneHasAFolderForEachController) {
  write("cgroup",
        "12:cpu,cpuacct:/docker/abc\n11:memory:/docker/abc\n10:cpuset:/docker/abc\n0::/x\n");
  write("fs/cpu,cpuacct/docker/abc/cpu.cfs_quota_us", "300000\n");
  write("fs/cpu,cpuacct/docker/abc/cpu.cfs_period_us", "100000\n");
  write("fs/memory/docker/abc/memory.limit_in_bytes", "1073741824\n");
  write("fs/memory/memory.limit_in_bytes", "9223372036854771712\n");
  expect(3, 1 << 30);
}

TEST_F(Cgroups, VersionOneInAContainerHasItAtTheTop) {
  write("cgroup", "4:memory:/docker/abc\n3:cpu,cpuacct:/docker/abc\n");
  write("fs/memory/memory.limit_in_bytes", "1073741824\n");
  write("fs/cpu/cpu.cfs_quota_us", "50000\n");
  write("fs/cpu/cpu.cfs_period_us", "100000\n");
  expect(0.5, 1 << 30);
}

TEST_F(Cgroups, NoQuotaAndNonsenseDoNotLimit) {
  write("cgroup", "no line\n4:memory:/a\n3:cpu:/a\n0::/a\n:\n");
  write("fs/cpu/a/cpu.cfs_quota_us", "-1\n");
  write("fs/cpu/a/cpu.cfs_period_us", "100000\n");
  write("fs/memory/a/memory.limit_in_bytes", "9223372036854771712\n");
  write("fs/a/cpu.max", "1000 0\n");
  write("fs/a/memory.max", "lots\n");
  write("fs/memory.max", "-5\n");
  expect(std::nullopt, std::nullopt);
}

TEST(MachineShare, AffinityDecidesTheThreads) {
  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  EXPECT_LE(usable_threads(), CPU_COUNT(&before));
  std::size_t first = 0;
  while (!CPU_ISSET(first, &before)) ++first;
  // Of a thread of its own: the affinity goes with it.
  std::int32_t threads = 0;
  std::thread([&] {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    if (sched_setaffinity(0, sizeof one, &one) == 0) threads = usable_threads();
  }).join();
  EXPECT_EQ(threads, 1);
}

TEST(MachineShare, TheDefaultOfMemoryIsNineTenthsOfTheShare) {
  EXPECT_GT(usable_memory_bytes(), 0);
  EXPECT_EQ(memory_limit_bytes(0), usable_memory_bytes() / 10 * 9);
  EXPECT_EQ(memory_limit_bytes(5), 5);
}

}  // namespace
}  // namespace qmpipe::testing::machine_share_test
