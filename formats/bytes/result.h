// What a function returns that reads bytes from outside, or makes something that may be impossible:
// a value, or an Error that says why not. Never throws for bad data (CONTRIBUTING, "Errors").
#pragma once

#include <string>
#include <utility>
#include <variant>

#include "scheduler/check.h"

namespace qmpipe {

// What is wrong, in a sentence without a full stop: "the index list ends after 12 of 40 bytes".
struct Error {
  std::string message;
};

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }
  // REQUIRES: ok().
  T& value() {
    QMPIPE_CHECK(ok());
    return *std::get_if<0>(&state_);
  }
  const T& value() const {
    QMPIPE_CHECK(ok());
    return *std::get_if<0>(&state_);
  }
  T& operator*() { return value(); }
  const T& operator*() const { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  // REQUIRES: !ok().
  const Error& error() const {
    QMPIPE_CHECK(!ok());
    return *std::get_if<1>(&state_);
  }

 private:
  std::variant<T, Error> state_;
};

}  // namespace qmpipe
