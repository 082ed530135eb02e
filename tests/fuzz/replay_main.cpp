// Runs a fuzz target without libFuzzer over the files of a folder and over seeded mutations of
// them: replay_main FOLDER. The same files give the same inputs on every run.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kMutationsPerFile = 2000;

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> text((std::istreambuf_iterator<char>(file)), {});
  return {text.begin(), text.end()};
}

// A flipped bit, another byte, a hostile number, bytes taken out or doubled, or a cut.
void mutate(Bytes& bytes, std::mt19937_64& random) {
  if (bytes.empty()) return;
  constexpr std::array<std::uint32_t, 6> kHostile = {0,          0xFFFFFFFF, 0x80000000,
                                                     0x7FFFFFFF, 0x10000,    0x55555556};
  const std::size_t at = random() % bytes.size();
  const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
  const std::size_t length = std::min<std::size_t>(1 + random() % 16, bytes.size() - at);
  const auto place_end = place + static_cast<std::ptrdiff_t>(length);
  switch (random() % 6) {
    case 0:
      *place ^= static_cast<std::uint8_t>(1U << (random() % 8));
      break;
    case 1:
      *place = static_cast<std::uint8_t>(random());
      break;
    case 2:
      for (std::size_t i = 0; i < std::min<std::size_t>(4, length); ++i) {
        bytes[at + i] = static_cast<std::uint8_t>(kHostile[random() % kHostile.size()] >> (8 * i));
      }
      break;
    case 3:
      bytes.erase(place, place_end);
      break;
    case 4: {
      const Bytes doubled(place, place_end);
      bytes.insert(place, doubled.begin(), doubled.end());
      break;
    }
    default:
      bytes.resize(at);
  }
}

void replay(const std::filesystem::path& path) {
  // Printed before the run, so that the file whose input crashes is the last one named.
  std::printf("%s\n", path.c_str());
  std::fflush(stdout);
  const Bytes bytes = read_file(path);
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  std::mt19937_64 random(bytes.size());
  for (int i = 0; i < kMutationsPerFile; ++i) {
    Bytes mutant = bytes;
    for (std::uint64_t left = 1 + random() % 4; left > 0; --left) mutate(mutant, random);
    LLVMFuzzerTestOneInput(mutant.data(), mutant.size());
  }
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) return 2;
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) {
    replay(entry.path());
    ++count;
  }
  std::printf("%d seeds\n", count);
  return count > 0 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
