// What another program prints, for tests with an independent reader.
#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace qmpipe::testing {

// Both streams of a shell command.
inline std::string output_of(const std::string& command) {
  std::string text;
  std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return text;
  std::array<char, 4096> buffer;
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) text += buffer.data();
  ::pclose(pipe);
  return text;
}

}  // namespace qmpipe::testing
