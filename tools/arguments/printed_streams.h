// What the program prints, made harmless at the one place that all of it passes (formats/bytes/printable.h),
// whoever prints it and whatever it says.
#pragma once

#include <cstdio>
#include <memory>

namespace qmpipe {

// For the end of a command: all that was printed to stdout is out. Throws IoError where it is not:
// who reads a report that is cut off must not be told that all went well.
void require_printed();

// While it lives, stdout and stderr are streams that pass everything through a PrintableFilter, and
// fail where the ones behind them do. The program's own control sequences go to the file descriptor
// (pipeline/run/progress.h). One at a time; made before and destroyed after all threads that print.
class PrintedStreams {
 public:
  PrintedStreams();
  ~PrintedStreams();
  PrintedStreams(const PrintedStreams&) = delete;
  PrintedStreams& operator=(const PrintedStreams&) = delete;

 private:
  struct Stream;
  void swap_streams();
  std::unique_ptr<Stream> out_;
  std::unique_ptr<Stream> err_;
};

}  // namespace qmpipe
