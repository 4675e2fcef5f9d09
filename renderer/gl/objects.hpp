// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <epoxy/gl.h>

#include <cstddef>
#include <span>
#include <utility>

#include "emit/physics/check.hpp"

/// Owning handles of GL objects, used by direct state access.
/// Thread: the one with the context.  Real time: construction is setup; bind and upload functions
/// allocate no memory of the process.
namespace emit::gl {

/// Buffer object with immutable storage.
class Buffer {
 public:
  Buffer() = default;
  /// Creates the storage. `flags` are those of glNamedBufferStorage; `data` may be null.
  Buffer(std::size_t bytes, const void* data, GLbitfield flags) : bytes_(bytes), flags_(flags) {
    glCreateBuffers(1, &id_);
    glNamedBufferStorage(id_, static_cast<GLsizeiptr>(bytes), data, flags);
  }
  ~Buffer() {
    if (id_ != 0) glDeleteBuffers(1, &id_);
  }
  Buffer(Buffer&& other) noexcept
      : id_(std::exchange(other.id_, 0)),
        bytes_(std::exchange(other.bytes_, 0)),
        flags_(std::exchange(other.flags_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(bytes_, other.bytes_);
    std::swap(flags_, other.flags_);
    return *this;
  }

  /// Creates a buffer that holds `data`.
  template <class T>
  [[nodiscard]] static Buffer from(std::span<const T> data, GLbitfield flags = 0) {
    return Buffer(data.size_bytes(), data.data(), flags);
  }

  /// Creates storage of at least 16 bytes that upload() can refill.
  [[nodiscard]] static Buffer dynamic(std::size_t bytes) {
    return Buffer(bytes < 16 ? 16 : bytes, nullptr, GL_DYNAMIC_STORAGE_BIT);
  }
  /// Copies `data` into the buffer, from element `first` on.
  /// @pre the buffer has GL_DYNAMIC_STORAGE_BIT, as dynamic() sets it, and the data fit into it
  template <class T>
  void upload(std::span<const T> data, std::size_t first = 0) const noexcept {
    EMIT_CHECK((flags_ & GL_DYNAMIC_STORAGE_BIT) != 0 || data.empty());
    EMIT_CHECK_OP(first * sizeof(T) + data.size_bytes(), <=, bytes_);
    if (data.empty()) return;
    glNamedBufferSubData(id_, static_cast<GLintptr>(first * sizeof(T)),
                         static_cast<GLsizeiptr>(data.size_bytes()), data.data());
  }

  /// Maps the whole buffer persistently and coherently, for its lifetime.
  /// @pre the storage was created with `access`, GL_MAP_PERSISTENT_BIT and GL_MAP_COHERENT_BIT
  [[nodiscard]] std::byte* map_persistent(GLbitfield access) const {
    const GLbitfield flags = access | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    EMIT_CHECK((flags_ & flags) == flags);
    return static_cast<std::byte*>(
        glMapNamedBufferRange(id_, 0, static_cast<GLsizeiptr>(bytes_), flags));
  }
  void bind_storage(GLuint binding) const noexcept {
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, id_);
  }
  void bind_uniform(GLuint binding) const noexcept {
    glBindBufferBase(GL_UNIFORM_BUFFER, binding, id_);
  }
  void bind_uniform(GLuint binding, std::size_t offset, std::size_t bytes) const noexcept {
    glBindBufferRange(GL_UNIFORM_BUFFER, binding, id_, static_cast<GLintptr>(offset),
                      static_cast<GLsizeiptr>(bytes));
  }
  void bind_storage(GLuint binding, std::size_t offset, std::size_t bytes) const noexcept {
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, binding, id_, static_cast<GLintptr>(offset),
                      static_cast<GLsizeiptr>(bytes));
  }
  [[nodiscard]] GLuint id() const noexcept { return id_; }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

 private:
  GLuint id_ = 0;
  std::size_t bytes_ = 0;
  GLbitfield flags_ = 0;
};

/// 2-D texture, or 2-D array texture when layers > 0, with one level. Filtering is nearest and
/// coordinates are clamped unless parameter() changes that.
class Texture {
 public:
  Texture() = default;
  Texture(GLenum format, GLsizei width, GLsizei height, GLsizei layers = 0) {
    const GLenum target = layers > 0 ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_2D;
    glCreateTextures(target, 1, &id_);
    if (layers > 0) {
      glTextureStorage3D(id_, 1, format, width, height, layers);
    } else {
      glTextureStorage2D(id_, 1, format, width, height);
    }
    parameter(GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    parameter(GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    parameter(GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    parameter(GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  }
  ~Texture() {
    if (id_ != 0) glDeleteTextures(1, &id_);
  }
  Texture(Texture&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  Texture& operator=(Texture&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }

  void parameter(GLenum name, GLenum value) const noexcept {
    glTextureParameteri(id_, name, static_cast<GLint>(value));
  }
  void bind(GLuint unit) const noexcept { glBindTextureUnit(unit, id_); }
  [[nodiscard]] GLuint id() const noexcept { return id_; }

 private:
  GLuint id_ = 0;
};

/// One-dimensional texture over the contents of a buffer, which must outlive it.
class BufferTexture {
 public:
  BufferTexture() = default;
  BufferTexture(GLenum format, const Buffer& buffer) {
    glCreateTextures(GL_TEXTURE_BUFFER, 1, &id_);
    glTextureBuffer(id_, format, buffer.id());
  }
  ~BufferTexture() {
    if (id_ != 0) glDeleteTextures(1, &id_);
  }
  BufferTexture(BufferTexture&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  BufferTexture& operator=(BufferTexture&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  void bind(GLuint unit) const noexcept { glBindTextureUnit(unit, id_); }

 private:
  GLuint id_ = 0;
};

/// Framebuffer object.
class Framebuffer {
 public:
  Framebuffer() = default;
  [[nodiscard]] static Framebuffer make() {
    Framebuffer framebuffer;
    glCreateFramebuffers(1, &framebuffer.id_);
    return framebuffer;
  }
  ~Framebuffer() {
    if (id_ != 0) glDeleteFramebuffers(1, &id_);
  }
  Framebuffer(Framebuffer&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  Framebuffer& operator=(Framebuffer&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  [[nodiscard]] GLuint id() const noexcept { return id_; }

 private:
  GLuint id_ = 0;
};

/// Vertex array object.
class VertexArray {
 public:
  VertexArray() = default;
  [[nodiscard]] static VertexArray make() {
    VertexArray array;
    glCreateVertexArrays(1, &array.id_);
    return array;
  }
  ~VertexArray() {
    if (id_ != 0) glDeleteVertexArrays(1, &id_);
  }
  VertexArray(VertexArray&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  VertexArray& operator=(VertexArray&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  [[nodiscard]] GLuint id() const noexcept { return id_; }

 private:
  GLuint id_ = 0;
};

}  // namespace emit::gl
