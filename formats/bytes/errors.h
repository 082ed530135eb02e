// Errors that end a run. Thrown where the environment or the user's request is at fault;
// tools/main.cpp turns them into exit codes (UsageError 2, all others 1).
#pragma once

#include <stdexcept>
#include <string>

namespace qmpipe {

// A file, disk, driver or library refused. The message says what failed, on which path, why, and
// what to do about it.
class IoError : public std::runtime_error {
 public:
  // `what_failed`: "cannot write the tile"; `path`; `cause`: the library's or system's words;
  // `remedy`: a sentence that tells the user what to try, may be empty.
  IoError(const std::string& what_failed, const std::string& path, const std::string& cause,
          const std::string& remedy)
      : std::runtime_error(what_failed + " " + path + ": " + cause +
                           (remedy.empty() ? "" : "\n  " + remedy)),
        path_(path) {}
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// The options or inputs do not make sense together. The message names the option and the remedy.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace qmpipe
