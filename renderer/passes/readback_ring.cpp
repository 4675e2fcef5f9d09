// SPDX-License-Identifier: Apache-2.0
#include "passes/readback_ring.hpp"

namespace emit::renderer {

ReadbackRing::ReadbackRing(std::uint32_t slots, std::size_t bytes_per_slot) : count_(slots) {
  EMIT_CHECK_OP(slots, >=, 1U);
  EMIT_CHECK_OP(slots, <=, kMaxSlots);
  EMIT_CHECK_OP(bytes_per_slot, >=, std::size_t{1});
  for (std::uint32_t i = 0; i < count_; ++i) {
    constexpr GLbitfield kFlags =
        GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT | GL_CLIENT_STORAGE_BIT;
    slots_[i].buffer = gl::Buffer(bytes_per_slot, nullptr, kFlags);
    slots_[i].mapped = slots_[i].buffer.map_persistent(GL_MAP_READ_BIT);
  }
}

ReadbackRing::~ReadbackRing() {
  for (Slot& slot : slots_) {
    if (slot.fence != nullptr) glDeleteSync(slot.fence);
  }
}

bool ReadbackRing::mapped() const noexcept {
  for (std::uint32_t i = 0; i < count_; ++i) {
    if (slots_[i].mapped == nullptr) return false;
  }
  return true;
}

void ReadbackRing::check_taken(std::uint32_t slot) const noexcept {
  EMIT_CHECK_OP(slot, <, count_);
  EMIT_CHECK(slots_[slot].used.load(std::memory_order_acquire));
}

int ReadbackRing::acquire() noexcept {
  for (std::uint32_t k = 0; k < count_; ++k) {
    const std::uint32_t i = (next_ + k) % count_;
    if (!slots_[i].used.exchange(true, std::memory_order_acq_rel)) {
      next_ = (i + 1) % count_;
      return static_cast<int>(i);
    }
  }
  return -1;
}

void ReadbackRing::copy_from(const gl::Buffer& source, std::uint32_t slot,
                             std::span<const Range> parts) noexcept {
  check_taken(slot);
  // Copy behind the stores of the shaders.
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  for (const Range& part : parts) {
    EMIT_CHECK_OP(part.offset_bytes + part.bytes, <=, source.bytes());
    EMIT_CHECK_OP(part.offset_bytes + part.bytes, <=, slots_[slot].buffer.bytes());
    const auto offset = static_cast<GLintptr>(part.offset_bytes);
    glCopyNamedBufferSubData(source.id(), slots_[slot].buffer.id(), offset, offset,
                             static_cast<GLsizeiptr>(part.bytes));
  }
  // Set a fence behind the copy and start the device.
  glMemoryBarrier(GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
  if (slots_[slot].fence != nullptr) glDeleteSync(slots_[slot].fence);
  slots_[slot].fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  glFlush();
}

bool ReadbackRing::ready(std::uint32_t slot) noexcept {
  check_taken(slot);
  if (slots_[slot].fence == nullptr) return true;
  const GLenum state = glClientWaitSync(slots_[slot].fence, 0, 0);
  return state != GL_TIMEOUT_EXPIRED;
}

bool ReadbackRing::wait(std::uint32_t slot) noexcept {
  check_taken(slot);
  if (slots_[slot].fence == nullptr) return false;
  constexpr GLuint64 kSecondNs = 1'000'000'000;
  // A software rasteriser may need minutes for a huge frame. A device that needs longer than this
  // hangs.
  constexpr int kMaxSeconds = 600;
  GLenum state = GL_TIMEOUT_EXPIRED;
  for (int i = 0; i < kMaxSeconds && state == GL_TIMEOUT_EXPIRED; ++i) {
    state = glClientWaitSync(slots_[slot].fence, GL_SYNC_FLUSH_COMMANDS_BIT, kSecondNs);
  }
  glDeleteSync(slots_[slot].fence);
  slots_[slot].fence = nullptr;
  return state != GL_WAIT_FAILED && state != GL_TIMEOUT_EXPIRED;
}

void ReadbackRing::release(std::uint32_t slot) noexcept {
  check_taken(slot);
  slots_[slot].used.store(false, std::memory_order_release);
}

}  // namespace emit::renderer
