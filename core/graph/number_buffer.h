// SPDX-License-Identifier: Apache-2.0
// Room for numbers that are written before they are read.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>

namespace loci {

// Unlike a std::vector, does not set to zero what it makes room for. Moved, not copied.
class NumberBuffer {
 public:
  NumberBuffer() = default;
  NumberBuffer(NumberBuffer&& other) noexcept
      : numbers_(std::move(other.numbers_)), capacity_(std::exchange(other.capacity_, 0)) {}
  NumberBuffer& operator=(NumberBuffer&& other) noexcept {
    numbers_ = std::move(other.numbers_);
    capacity_ = std::exchange(other.capacity_, 0);
    return *this;
  }

  // Room for at least `count` numbers, and not for many times as many. What was there may be lost.
  double* Renew(std::size_t count) {
    if (count > capacity_ || 2 * count + kSpare < capacity_) {
      Allocate(count);
    }
    return numbers_.get();
  }
  // The same, but the first `kept` numbers stay, and room that there is.
  double* Grow(std::size_t count, std::size_t kept) {
    if (count > capacity_) {
      const std::unique_ptr<double[]> before = std::move(numbers_);
      Allocate(std::max(count, 2 * capacity_));
      std::copy_n(before.get(), kept, numbers_.get());
    }
    return numbers_.get();
  }
  double* data() { return numbers_.get(); }
  const double* data() const { return numbers_.get(); }

 private:
  static constexpr std::size_t kSpare = 64;

  void Allocate(std::size_t count) {
    numbers_ = std::make_unique_for_overwrite<double[]>(count);
    capacity_ = count;
  }

  std::unique_ptr<double[]> numbers_;
  std::size_t capacity_ = 0;
};

}  // namespace loci
