// SPDX-License-Identifier: Apache-2.0
#include "clients/log/line_source.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include <bzlib.h>
#include <zlib.h>

namespace loci {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{1} << 17U;

struct FileCloser {
  void operator()(std::FILE* file) const { IgnoreClose(std::fclose(file)); }
  static void IgnoreClose(int) {}  // only read from: nothing can be lost
};
using File = std::unique_ptr<std::FILE, FileCloser>;

StatusOr<std::size_t> ReadFile(std::FILE* file, char* buffer, std::size_t size_bytes) {
  const std::size_t count = std::fread(buffer, 1, size_bytes, file);
  if (count == 0 && std::ferror(file) != 0) {
    return Status(StatusCode::kUnknown, std::string("read failed: ") + std::strerror(errno));
  }
  return count;
}

class PlainSource : public ByteSource {
 public:
  explicit PlainSource(File file) : file_(std::move(file)) {}

  StatusOr<std::size_t> Read(char* buffer, std::size_t size_bytes) override {
    return ReadFile(file_.get(), buffer, size_bytes);
  }

 private:
  File file_;
};

// What gzip and bzip2 share: compressed input in chunks, and files that are several streams, one
// after the other (as `cat a.gz b.gz` and parallel compressors make them).
class CompressedSource : public ByteSource {
 public:
  explicit CompressedSource(File file) : file_(std::move(file)) {}

 protected:
  enum class Step { kOk, kStreamEnd, kDamaged };

  StatusOr<std::size_t> ReadStreams(char* buffer, std::size_t size_bytes) {
    while (true) {
      if (input_size_ == 0 && !input_ended_) {
        LOCI_ASSIGN_OR_RETURN(input_size_, ReadFile(file_.get(), input_.data(), input_.size()));
        input_begin_ = 0;
        input_ended_ = input_size_ == 0;
      }
      if (input_size_ == 0 && between_streams_) {
        return std::size_t{0};
      }
      if (between_streams_ && !Restart()) {
        return InternalError("the decompressor cannot be started");
      }
      between_streams_ = false;
      std::size_t produced = 0;
      const Step step = Decompress(buffer, size_bytes, &produced);
      between_streams_ = step == Step::kStreamEnd;
      if (produced > 0) {
        return produced;
      }
      if (step == Step::kDamaged) {
        return DataLossError("the compressed stream is damaged");
      }
      if (step == Step::kOk && input_size_ == 0 && input_ended_) {
        return DataLossError("the compressed stream ends too early");
      }
    }
  }

  // Takes from `input()`, writes to `buffer`.
  virtual Step Decompress(char* buffer, std::size_t size_bytes, std::size_t* produced) = 0;
  virtual bool Restart() = 0;

  char* input() { return input_.data() + input_begin_; }
  std::size_t input_size() const { return input_size_; }
  void Consume(std::size_t count) {
    input_begin_ += count;
    input_size_ -= count;
  }

 private:
  File file_;
  std::array<char, kChunkBytes> input_;
  std::size_t input_begin_ = 0;
  std::size_t input_size_ = 0;
  bool input_ended_ = false;
  bool between_streams_ = true;
};

class GzipSource : public CompressedSource {
 public:
  using CompressedSource::CompressedSource;
  GzipSource(const GzipSource&) = delete;
  GzipSource& operator=(const GzipSource&) = delete;
  ~GzipSource() override { inflateEnd(&stream_); }

  StatusOr<std::size_t> Read(char* buffer, std::size_t size_bytes) override {
    return ReadStreams(buffer, size_bytes);
  }

 protected:
  Step Decompress(char* buffer, std::size_t size_bytes, std::size_t* produced) override {
    // zlib's interface takes bytes as unsigned char.
    stream_.next_in = reinterpret_cast<Bytef*>(input());
    stream_.avail_in = static_cast<uInt>(input_size());
    stream_.next_out = reinterpret_cast<Bytef*>(buffer);
    stream_.avail_out = static_cast<uInt>(size_bytes);
    const int result = inflate(&stream_, Z_NO_FLUSH);
    Consume(input_size() - stream_.avail_in);
    *produced = size_bytes - stream_.avail_out;
    if (result == Z_STREAM_END) {
      return Step::kStreamEnd;
    }
    return result == Z_OK || result == Z_BUF_ERROR ? Step::kOk : Step::kDamaged;
  }

  bool Restart() override {
    inflateEnd(&stream_);
    stream_ = {};
    return inflateInit2(&stream_, 15 + 16) == Z_OK;  // largest window, gzip header
  }

 private:
  z_stream stream_ = {};
};

class Bzip2Source : public CompressedSource {
 public:
  using CompressedSource::CompressedSource;
  Bzip2Source(const Bzip2Source&) = delete;
  Bzip2Source& operator=(const Bzip2Source&) = delete;
  ~Bzip2Source() override { BZ2_bzDecompressEnd(&stream_); }

  StatusOr<std::size_t> Read(char* buffer, std::size_t size_bytes) override {
    return ReadStreams(buffer, size_bytes);
  }

 protected:
  Step Decompress(char* buffer, std::size_t size_bytes, std::size_t* produced) override {
    stream_.next_in = input();
    stream_.avail_in = static_cast<unsigned>(input_size());
    stream_.next_out = buffer;
    stream_.avail_out = static_cast<unsigned>(size_bytes);
    const int result = BZ2_bzDecompress(&stream_);
    Consume(input_size() - stream_.avail_in);
    *produced = size_bytes - stream_.avail_out;
    if (result == BZ_STREAM_END) {
      return Step::kStreamEnd;
    }
    return result == BZ_OK ? Step::kOk : Step::kDamaged;
  }

  bool Restart() override {
    BZ2_bzDecompressEnd(&stream_);
    stream_ = {};
    return BZ2_bzDecompressInit(&stream_, 0, 0) == BZ_OK;
  }

 private:
  bz_stream stream_ = {};
};

}  // namespace

StatusOr<std::unique_ptr<ByteSource>> OpenByteSource(const std::string& path) {
  File file(std::fopen(path.c_str(), "rb"));
  if (file == nullptr) {
    const int error = errno;
    const std::string message = path + ": " + std::strerror(error);
    return error == EACCES ? PermissionDeniedError(message) : NotFoundError(message);
  }
  std::array<char, 3> magic = {};
  const std::size_t count = std::fread(magic.data(), 1, magic.size(), file.get());
  if (count == 0 && std::ferror(file.get()) != 0) {  // a folder, for example
    return InvalidArgumentError(path + ": " + std::strerror(errno));
  }
  std::rewind(file.get());
  const std::string_view begin(magic.data(), count);
  if (begin.starts_with("\x1f\x8b")) {
    return std::unique_ptr<ByteSource>(std::make_unique<GzipSource>(std::move(file)));
  }
  if (begin == "BZh") {
    return std::unique_ptr<ByteSource>(std::make_unique<Bzip2Source>(std::move(file)));
  }
  return std::unique_ptr<ByteSource>(std::make_unique<PlainSource>(std::move(file)));
}

LineSource::LineSource(std::unique_ptr<ByteSource> bytes) : bytes_(std::move(bytes)) {}

Status LineSource::Fill() {
  buffer_.erase(0, begin_);
  scanned_ -= begin_;
  begin_ = 0;
  const std::size_t old_size = buffer_.size();
  buffer_.resize(old_size + kChunkBytes);
  StatusOr<std::size_t> count = bytes_->Read(buffer_.data() + old_size, kChunkBytes);
  buffer_.resize(old_size + (count.ok() ? *count : 0));
  LOCI_RETURN_IF_ERROR(count.status());
  at_end_ = *count == 0;
  return {};
}

std::optional<LineSource::Line> LineSource::TakeLine() {
  const std::size_t newline = buffer_.find('\n', scanned_);
  scanned_ = newline == std::string::npos ? buffer_.size() : newline;
  const std::size_t length = scanned_ - begin_;
  const bool ended = newline != std::string::npos;
  const bool too_long = length > kLineBytesMax;
  if (!ended && !too_long && !(at_end_ && length > 0)) {
    return std::nullopt;
  }
  Line line;
  line.text = std::string_view(buffer_).substr(begin_, too_long ? kLineBytesMax : length);
  line.ended = ended && !too_long;
  begin_ = ended ? scanned_ + 1 : scanned_;
  scanned_ = begin_;
  const bool rest_of_long_line = skipping_;
  skipping_ = !ended && !at_end_;
  if (rest_of_long_line) {
    return Line{};  // number 0: nothing to return
  }
  if (line.text.ends_with('\r')) {
    line.text.remove_suffix(1);
  }
  line.number = ++line_number_;
  return line;
}

StatusOr<std::optional<LineSource::Line>> LineSource::Next() {
  LOCI_RETURN_IF_ERROR(status_);
  while (true) {
    const std::optional<Line> line = TakeLine();
    if (line.has_value() && line->number > 0) {
      return line;
    }
    if (line.has_value()) {
      continue;
    }
    if (at_end_) {
      return std::optional<Line>();
    }
    status_ = Fill();
    if (!status_.ok()) {
      ++line_number_;  // the damage is in the line after the last whole one
      return status_;
    }
  }
}

}  // namespace loci
