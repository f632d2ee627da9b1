// Paints down from its own frame and looks up from the bottom.
#include "robot_fw/lx106/stack_gauge.hpp"

#include <cstddef>

namespace robot_fw::lx106 {
namespace {

constexpr std::uint32_t kPaint = 0xC0DE'5AFE;
constexpr std::size_t kPaintedBytes = 8192;
constexpr std::size_t kOwnBytes = 64;  // of the functions here

}  // namespace

// volatile: the compiler must not call memset, which would need a frame of its own, nor leave the paint out.
[[gnu::noinline]] void paint_stack() {
  auto* top = static_cast<volatile std::uint32_t*>(__builtin_frame_address(0)) - kOwnBytes / sizeof(kPaint);
  for (std::size_t i = 1; i <= kPaintedBytes / sizeof(kPaint); ++i) top[-static_cast<std::ptrdiff_t>(i)] = kPaint;
}

[[gnu::noinline]] std::uint32_t used_stack_bytes() {
  auto* base = static_cast<volatile std::uint32_t*>(__builtin_frame_address(0));
  auto* at = base - (kOwnBytes + kPaintedBytes) / sizeof(kPaint);
  while (at < base - kOwnBytes / sizeof(kPaint) && *at == kPaint) ++at;
  return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(base) - reinterpret_cast<std::uintptr_t>(at));
}

}  // namespace robot_fw::lx106
