// SPDX-License-Identifier: Apache-2.0
// Sweeps of gradient descent ask for no memory.
#include <cstddef>
#include <cstdlib>
#include <new>

#include <gtest/gtest.h>

#include "core/graph/space_toro.h"
#include "core/graph/toro_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"

namespace {

std::size_t allocation_count = 0;  // by this program, which has one thread

void* AllocateOrNull(std::size_t size_bytes) {
  ++allocation_count;
  return std::malloc(size_bytes);
}
void* Allocate(std::size_t size_bytes) {
  void* memory = AllocateOrNull(size_bytes);
  if (memory == nullptr) {
    throw std::bad_alloc();
  }
  return memory;
}

}  // namespace

void* operator new(std::size_t size_bytes) {
  return Allocate(size_bytes);
}
void* operator new[](std::size_t size_bytes) {
  return Allocate(size_bytes);
}
// std::stable_sort takes its buffer with these; a sanitizer's own would not match the delete below.
void* operator new(std::size_t size_bytes, const std::nothrow_t& /*tag*/) noexcept {
  return AllocateOrNull(size_bytes);
}
void* operator new[](std::size_t size_bytes, const std::nothrow_t& /*tag*/) noexcept {
  return AllocateOrNull(size_bytes);
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete[](void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t /*size_bytes*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t /*size_bytes*/) noexcept {
  std::free(memory);
}

namespace loci {
namespace {

// Of ten sweeps after the first, which builds the arrays.
template <typename Toro>
std::size_t AllocationsOfSweeps(Toro& toro) {
  toro.Sweep();
  const std::size_t before = allocation_count;
  for (int i = 0; i < 10; ++i) {
    toro.Sweep();
  }
  return allocation_count - before;
}

TEST(ToroAllocationTest, AllocationsAreCounted) {
  const std::size_t before = allocation_count;
  ToroOptimizer toro(RandomManhattanGraph(1, 10));
  EXPECT_GT(allocation_count, before);
}

TEST(ToroAllocationTest, SweepsInThePlaneAllocateNothing) {
  ToroOptimizer toro(RandomManhattanGraph(1, 500));
  EXPECT_EQ(AllocationsOfSweeps(toro), 0U);
}

TEST(ToroAllocationTest, SweepsInSpaceAllocateNothing) {
  SpaceToroOptimizer toro(RandomSpaceLoops(1, 200));
  EXPECT_EQ(AllocationsOfSweeps(toro), 0U);
}

}  // namespace
}  // namespace loci
