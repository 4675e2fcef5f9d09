// SPDX-License-Identifier: Apache-2.0
#include "console/explainer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <exception>
#include <string_view>

#include "console/console_message.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "rt/error_text.hpp"
#include "rt/fd.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::chrono::milliseconds kPause{20};
constexpr std::chrono::seconds kJournalPatience{10};
constexpr std::size_t kMostOutputBytes = 16u << 20;

/// A folder that goes with its files.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "emitd-explain-XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

struct Pipe {
  Fd read;
  Fd write;
};
std::optional<Pipe> make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return std::nullopt;
  return Pipe{Fd(ends[0]), Fd(ends[1])};
}

/// Starts a program with both outputs in pipes and no other descriptor of this process. Returns
/// its id, or 0 with errno set.
pid_t spawn(const std::vector<std::string>& arguments, int output_fd, int error_fd) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, output_fd, STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, error_fd, STDERR_FILENO);
  ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t none;
  ::sigemptyset(&none);
  sigset_t all;
  ::sigfillset(&all);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setsigdefault(&attributes, &all);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_t child = 0;
  const int error =
      ::posix_spawn(&child, argv.front(), &actions, &attributes, argv.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  errno = error;
  return error == 0 ? child : 0;
}

/// Moves what has come on a descriptor to `out`. Returns false at its end.
bool read_some(int fd, std::string& out) {
  std::array<char, 65536> bytes{};
  const ssize_t got = ::read(fd, bytes.data(), bytes.size());
  if (got < 0) return errno == EINTR || errno == EAGAIN;
  if (out.size() < kMostOutputBytes) out.append(bytes.data(), static_cast<std::size_t>(got));
  return got > 0;
}

/// Lines of the child's standard error that begin so, without that begin.
std::vector<std::string> lines_with(std::string_view text, std::string_view begin) {
  std::vector<std::string> out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    if (line.starts_with(begin)) out.emplace_back(line.substr(begin.size()));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

std::string list_of(const std::vector<std::string>& texts) {
  std::string out = "[";
  for (const std::string& text : texts) {
    if (out.size() > 1) out += ',';
    out += json_string(text);
  }
  return out + "]";
}

}  // namespace

Explainer::Explainer(std::vector<std::string> command, JournalTap& journal,
                     std::function<void()> on_done)
    : command_(std::move(command)), journal_(journal), on_done_(std::move(on_done)) {
  thread_ = std::thread([this] { run(); });
}

Explainer::~Explainer() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

bool Explainer::ask(const ExplainRequest& request) {
  {
    const std::scoped_lock lock(mutex_);
    std::erase_if(waiting_, [&](const ExplainRequest& one) { return one.page == request.page; });
    if (waiting_.size() >= kMaxWaiting) return false;
    waiting_.push_back(request);
  }
  changed_.notify_all();
  return true;
}

std::optional<Explained> Explainer::take() {
  const std::scoped_lock lock(mutex_);
  if (done_.empty()) return std::nullopt;
  Explained out = std::move(done_.front());
  done_.pop_front();
  return out;
}

bool Explainer::pause() {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, kPause, [this] { return stop_; });
}

void Explainer::run() {
  constexpr int kNice = 19;
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
  for (;;) {
    ExplainRequest request;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return stop_ || !waiting_.empty(); });
      if (stop_) return;
      request = waiting_.front();
      waiting_.pop_front();
    }
    std::string json;
    try {
      json = answer(request);
    } catch (const std::exception&) {
      continue;  // without memory for it the page gets no answer, and may ask again
    }
    {
      const std::scoped_lock lock(mutex_);
      done_.push_back({request.page, std::move(json)});
    }
    on_done_();
  }
}

std::string Explainer::answer(const ExplainRequest& request) {
  const auto start = std::chrono::steady_clock::now();
  const TemporaryFolder folder;
  const std::filesystem::path journal = folder.path() / "run.mcap";
  std::vector<std::string> warnings;
  Result<std::string> found =
      make_error(ErrorCode::io, "no folder for temporary files: " + error_text(errno));
  if (!folder.path().empty()) {
    const auto written = write_journal(journal);
    found = written ? explain(request, journal, warnings)
                    : Result<std::string>(tl::unexpected<physics::Error>(written.error()));
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return fmt::format(
      R"({{"type":"explanation","channel":{},"x":{},"y":{},"frame":{},"seconds":{:.3f},)"
      R"("warnings":{},"error":{},"result":{}}})",
      request.channel, request.x_px, request.y_px, request.frame_number, seconds, list_of(warnings),
      found ? "null" : json_string(found.error().text), found ? *found : std::string("null"));
}

Result<void> Explainer::write_journal(const std::filesystem::path& file) {
  const auto end = std::chrono::steady_clock::now() + kJournalPatience;
  const auto fail = [](const char* text) { return make_error(ErrorCode::internal, text); };
  bool asked = false;
  while (!journal_.is_ready() || !asked) {
    // An answer that an earlier question did not wait for is dropped.
    if (!asked) asked = journal_.ask();
    if (std::chrono::steady_clock::now() > end) return fail("the recorder does not answer");
    if (!pause()) return fail("emitd ends");
  }
  const std::vector<std::byte> records = journal_.take();
  auto log = protocol::LogWriter::create(file);
  if (!log) return tl::unexpected(log.error());
  protocol::RecordParser parser({});
  protocol::Record record;
  v1::ControlRecord message;
  for (std::size_t at = 0; at < records.size();) {
    const auto space = parser.writable();
    const std::size_t count = std::min(space.size(), records.size() - at);
    std::memcpy(space.data(), records.data() + at, count);
    parser.commit(count);
    at += count;
    while (parser.next(record) == protocol::ParseStatus::record) {
      if (!protocol::parse_control_record(record.body, message) || !message.has_journal()) continue;
      if (auto written = log->write_journal(message.journal()); !written) return written;
    }
  }
  return log->close();
}

Result<std::string> Explainer::explain(const ExplainRequest& request,
                                       const std::filesystem::path& journal,
                                       std::vector<std::string>& warnings) {
  std::vector<std::string> arguments = command_;
  for (const std::string& each :
       {std::string("--run"), journal.string(), std::string("--frame"),
        fmt::to_string(request.frame_number), std::string("--px"),
        fmt::format("{},{}", request.sensor_x_px, request.sensor_y_px), std::string("--background"),
        std::string("--json"), std::string("-")}) {
    arguments.push_back(each);
  }
  auto output = make_pipe();
  auto errors = make_pipe();
  if (!output || !errors) return make_error(ErrorCode::io, "pipe: " + error_text(errno));
  const pid_t child = spawn(arguments, output->write.get(), errors->write.get());
  if (child == 0) {
    return make_error(ErrorCode::io, arguments.front() + ": " + error_text(errno));
  }
  output->write = Fd();
  errors->write = Fd();
  std::string text;
  std::string said;
  std::array<pollfd, 2> wait{{{output->read.get(), POLLIN, 0}, {errors->read.get(), POLLIN, 0}}};
  bool ends = false;
  while (wait[0].fd >= 0 || wait[1].fd >= 0) {
    if (!ends && !pause()) {
      // The process ends with this one; its pipes close, and the loop with them.
      ::kill(child, SIGKILL);
      ends = true;
    }
    ::poll(wait.data(), wait.size(), static_cast<int>(kPause.count()));
    for (pollfd& one : wait) {
      if (one.fd < 0 || (one.revents & (POLLIN | POLLHUP | POLLERR)) == 0) continue;
      if (!read_some(one.fd, &one == wait.data() ? text : said)) one.fd = -1;
    }
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  warnings = lines_with(said, "emit: warning: ");
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return text;
  const std::vector<std::string> reasons = lines_with(said, "emit: error: ");
  return make_error(ErrorCode::internal,
                    !reasons.empty() ? reasons.front()
                    : WIFSIGNALED(status)
                        ? fmt::format("emit explain ended by signal {}", WTERMSIG(status))
                        : fmt::format("emit explain ended with {}", WEXITSTATUS(status)));
}

}  // namespace emit::server
