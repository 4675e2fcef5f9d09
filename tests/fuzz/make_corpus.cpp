// SPDX-License-Identifier: Apache-2.0
// Program that writes the binary seeds of corpus/: make_corpus FOLDER. Text seeds and former
// findings (regression_*) are kept in the corpus as they are.
#include <bit>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "emit/protocol/axes.hpp"
#include "emit/protocol/axes_memory.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/host_session.hpp"
#include "emit/protocol/net_fdm.hpp"
#include "emit/protocol/pixel_codec.hpp"
#include "emit/protocol/record/frame_log.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/protocol/record/mcap_writer.hpp"
#include "emit/protocol/resend.hpp"
#include "emit/protocol/trigger.hpp"
#include "emit/protocol/trigger_seal.hpp"
#include "emit/scenegen/generate.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/frame.pb.h"
#include "fuzz/state_world.hpp"
#include "protocol/cigi/cigi_samples.hpp"
#include "protocol/dis/dis_samples.hpp"
#include "protocol/frames.hpp"
#include "protocol/host_frames.hpp"

namespace {

using namespace emit;
namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

fs::path root;

fs::path seed(const char* target, const char* name) {
  fs::create_directories(root / target);
  return root / target / name;
}

void write(const char* target, const char* name, std::span<const std::byte> bytes) {
  std::ofstream out(seed(target, name), std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
}

void append(Bytes& out, std::span<const std::byte> more) {
  out.insert(out.end(), more.begin(), more.end());
}
template <class T>
void append_number(Bytes& out, T value, bool big_endian = false) {
  Bytes bytes(sizeof value);
  std::memcpy(bytes.data(), &value, sizeof value);
  if (big_endian) std::reverse(bytes.begin(), bytes.end());
  append(out, bytes);
}

Bytes host_frame(std::uint32_t entities) {
  protocol::HostFrameEncoder encoder;
  const auto encoded = encoder.encode(*test::make_host_frame(entities));
  return {encoded.begin(), encoded.end()};
}

Bytes record(protocol::RecordKind kind, std::span<const std::byte> body) {
  Bytes out(protocol::kRecordHeaderBytes);
  protocol::encode_record_header(kind, static_cast<std::uint32_t>(body.size()),
                                 std::span(out).first<protocol::kRecordHeaderBytes>());
  append(out, body);
  return out;
}

Bytes record(const v1::ControlRecord& message) {
  Bytes out;
  protocol::append_control_record(message, out);
  return out;
}

Bytes frame_record(std::uint64_t number) {
  const test::Frame frame = test::make_frame(4, 3, number);
  Bytes body(frame.header_bytes.begin(), frame.header_bytes.end());
  append(body, frame.pixels);
  return record(protocol::RecordKind::frame, body);
}

/// Returns a record of the same image size with a single pixel value, so that it compresses.
Bytes encoded_frame_record(std::uint64_t number) {
  test::Frame frame = test::make_frame(4, 3, number);
  for (std::size_t i = 4; i < frame.pixels.size(); ++i) frame.pixels[i] = frame.pixels[i - 4];
  protocol::PixelEncoder encoder(frame.pixels.size());
  encoder.begin(frame.pixels);
  while (!encoder.encode_block()) {
  }
  frame.header.payload_crc32c = protocol::crc32c(frame.pixels);
  frame.header.encoding = protocol::PixelEncoding::shuffled_lz4;
  frame.header.encoded_bytes = static_cast<std::uint32_t>(encoder.bytes().size());
  protocol::encode(frame.header, frame.header_bytes);
  Bytes body(frame.header_bytes.begin(), frame.header_bytes.end());
  append(body, encoder.bytes());
  return record(protocol::RecordKind::frame, body);
}

void fill(v1::ChannelInfo& channel) {
  channel.set_name("lwir");
  channel.set_kind("injection");
  channel.set_sensor("seeker");
  channel.set_band("8-12");
  channel.set_band_lo_um(8.0);
  channel.set_band_hi_um(12.0);
  channel.set_width_px(4);
  channel.set_height_px(3);
  for (const double at_um : {8.0, 10.0, 12.0}) {
    channel.add_response_um(at_um);
    channel.add_response_frac(at_um == 10.0 ? 1.0 : 0.5);
  }
}

v1::ControlRecord hello(v1::Hello::Role role) {
  v1::ControlRecord out;
  out.mutable_hello()->set_protocol_version(protocol::kProtocolVersion);
  out.mutable_hello()->set_software("seed");
  out.mutable_hello()->set_role(role);
  return out;
}
v1::ControlRecord welcome() {
  v1::ControlRecord out;
  out.mutable_welcome()->set_protocol_version(protocol::kProtocolVersion);
  out.mutable_welcome()->set_scenario("airfield");
  out.mutable_welcome()->set_run_id(7);
  fill(*out.mutable_welcome()->add_channels());
  return out;
}
v1::ControlRecord subscribe(std::uint32_t udp_port, const char* group) {
  v1::ControlRecord out;
  out.mutable_subscribe()->set_band("8-12");
  out.mutable_subscribe()->set_udp_port(udp_port);
  out.mutable_subscribe()->set_multicast_group(group);
  return out;
}
v1::ControlRecord subscribed() {
  v1::ControlRecord out;
  fill(*out.mutable_subscribed()->mutable_channel());
  out.mutable_subscribed()->set_stream_id(1);
  return out;
}
v1::ControlRecord status() {
  v1::ControlRecord out;
  out.mutable_status()->set_code(v1::Status::CODE_UNKNOWN_ENTITY);
  out.mutable_status()->set_text("unknown entity 3");
  out.mutable_status()->set_count(2);
  return out;
}
v1::ControlRecord command(v1::Command::Kind kind) {
  v1::ControlRecord out;
  out.mutable_command()->set_kind(kind);
  return out;
}
v1::JournalEntry decision() {
  v1::JournalEntry out;
  out.set_sequence(3);
  out.set_wall_time_ns(1'000'000'000);
  v1::FrameDecision& frame = *out.mutable_frame();
  frame.set_frame_number(1);
  frame.set_radiance_crc32c(77);
  frame.set_rendered(true);
  const auto host = test::make_host_frame(3);
  protocol::to_proto(host->seeker, host->seeker_rates, *frame.mutable_sensor_pose());
  for (const auto& entity : host->entity_span()) protocol::to_proto(entity, *frame.add_entities());
  return out;
}
v1::JournalEntry run_start() {
  v1::JournalEntry out;
  out.set_sequence(1);
  out.mutable_run_start()->set_run_id(7);
  out.mutable_run_start()->set_scenario_name("airfield");
  return out;
}
v1::ControlRecord journal(const v1::JournalEntry& entry) {
  v1::ControlRecord out;
  *out.mutable_journal() = entry;
  return out;
}

Bytes joined(std::initializer_list<Bytes> parts) {
  Bytes out;
  for (const Bytes& part : parts) append(out, part);
  return out;
}
/// Returns a piece in the form that the targets receiver and fragments read.
Bytes piece(std::uint8_t instructions, const Bytes& bytes) {
  Bytes out{std::byte{instructions}};
  append_number(out, static_cast<std::uint16_t>(bytes.size()));
  append(out, bytes);
  return out;
}

void make_network_seeds() {
  write("host_datagram", "plain", host_frame(0));
  write("host_datagram", "entities", host_frame(5));

  v1::ControlRecord wrapped;
  protocol::to_proto(*test::make_host_frame(1), *wrapped.mutable_host_frame());
  Bytes stream{std::byte{31}};
  append(stream, record(hello(v1::Hello::ROLE_HOST)));
  append(stream, record(protocol::RecordKind::host_frame, host_frame(2)));
  append(stream, record(wrapped));
  append(stream, frame_record(1));
  append(stream, record(static_cast<protocol::RecordKind>(9), host_frame(0)));
  write("record_stream", "mixed", stream);

  const std::pair<const char*, v1::ControlRecord> messages[] = {
      {"hello", hello(v1::Hello::ROLE_CLIENT)},
      {"welcome", welcome()},
      {"subscribe", subscribe(7002, "239.1.2.3")},
      {"subscribed", subscribed()},
      {"command", command(v1::Command::KIND_STEP)},
      {"host_frame", wrapped},
      {"status", status()},
      {"journal_decision", journal(decision())},
      {"journal_run_start", journal(run_start())}};
  for (const auto& [name, message] : messages) {
    const Bytes wire = record(message);
    write("control_record", name, std::span(wire).subspan(protocol::kRecordHeaderBytes));
  }

  const Bytes tcp{std::byte{0}};
  const Bytes udp{std::byte{1}};
  write("frame_client", "two_frames",
        joined({tcp, record(welcome()), record(subscribed()), record(status()), frame_record(1),
                frame_record(3)}));
  v1::ControlRecord compressed = subscribed();
  compressed.mutable_subscribed()->set_compression(v1::COMPRESSION_SHUFFLED_LZ4);
  write("frame_client", "encoded",
        joined({tcp, record(welcome()), record(compressed), encoded_frame_record(1),
                frame_record(2), encoded_frame_record(3)}));
  write("frame_client", "udp",
        joined({udp, record(welcome()), record(subscribed()), record(status())}));
  v1::ControlRecord huge = subscribed();
  huge.mutable_subscribed()->mutable_channel()->set_width_px(~0u);
  huge.mutable_subscribed()->mutable_channel()->set_height_px(~0u);
  write("frame_client", "udp_huge_channel", joined({udp, record(welcome()), record(huge)}));
  v1::ControlRecord granted = subscribed();
  granted.mutable_subscribed()->mutable_error_correction()->set_data_fragments(4);
  granted.mutable_subscribed()->mutable_error_correction()->set_parity_fragments(2);
  granted.mutable_subscribed()->set_resend(true);
  write("frame_client", "udp_help", joined({udp, record(welcome()), record(granted)}));
  write("frame_client", "refused", joined({tcp, record(status())}));
  write("host_client", "answers", joined({record(welcome()), record(status()), record(status())}));
  write("recorder_client", "journal",
        joined({record(welcome()), record(journal(run_start())), record(journal(decision()))}));

  const Bytes host = record(hello(v1::Hello::ROLE_HOST));
  const Bytes client = record(hello(v1::Hello::ROLE_CLIENT));
  write("receiver", "host",
        joined({piece(0, host), piece(0, record(protocol::RecordKind::host_frame, host_frame(1))),
                piece(4, record(command(v1::Command::KIND_HOLD))), piece(0, record(wrapped))}));
  write("receiver", "client_tcp", joined({piece(0, client), piece(0, record(subscribe(0, "")))}));
  write("receiver", "client_udp",
        joined({piece(0, client), piece(0, record(subscribe(7002, ""))), piece(2, client)}));
  write("receiver", "client_group",
        joined({piece(0, client), piece(0, record(subscribe(7002, "239.1.2.3")))}));
  v1::ControlRecord help = subscribe(7002, "");
  help.mutable_subscribe()->mutable_error_correction()->set_data_fragments(4);
  help.mutable_subscribe()->mutable_error_correction()->set_parity_fragments(2);
  help.mutable_subscribe()->set_resend(true);
  protocol::ResendRequest missing;
  missing.stream_id = 1;
  missing.count = 2;
  missing.ranges[0] = {0, 400};
  missing.ranges[1] = {800, 4};
  Bytes body(protocol::kMaxResendBytes);
  body.resize(protocol::encode(missing, std::span(body).first<protocol::kMaxResendBytes>()));
  write("receiver", "client_resend",
        joined({piece(0, client), piece(0, record(help)),
                piece(0, record(protocol::RecordKind::resend, body))}));
  write("receiver", "recorder", piece(0, record(hello(v1::Hello::ROLE_RECORDER))));
  write("receiver", "reset",
        joined({piece(8, record(welcome())), piece(0, host),
                piece(8, record(protocol::RecordKind::host_frame, host))}));
  write("receiver", "datagrams", joined({piece(1, host_frame(0)), piece(1, host_frame(2))}));
}

/// Writes frames that lost fragments: repaired by parity, beyond repair, and waited for.
void make_loss_seeds() {
  const protocol::FecParams fec{3, 2};  // the parameters of the target
  const test::Frame frame = test::make_frame(32, 20, 1);
  const auto data = test::datagrams_of(frame, 400, 1);
  protocol::Fragmenter::Params params;
  params.stream_id = 1;
  params.frame_id = 1;
  params.sim_time_ns = frame.header.sim_time_ns;
  params.row_bytes = 128;
  params.max_payload_bytes = 400;
  const protocol::Fragmenter cut(params, frame.header_bytes, frame.pixels);
  protocol::ParityEncoder encoder(fec, cut);
  encoder.begin();
  while (!encoder.encode_some(cut, 1)) {
  }
  const auto parity = [&encoder](std::uint32_t index) {
    const auto bytes = encoder.datagrams(index, 1);
    return Bytes(bytes.begin(), bytes.end());
  };
  Bytes repaired;
  Bytes beyond;
  for (std::size_t i = 0; i < data.size(); ++i) {
    const auto instructions = static_cast<std::uint8_t>(i == 0 ? 1 : 2);
    if (i % 4 != 1) append(repaired, piece(instructions, data[i]));
    if (i % 2 == 0) append(beyond, piece(instructions, data[i]));
  }
  for (std::uint32_t i = 0; i < encoder.datagram_count(); ++i) {
    append(repaired, piece(4, parity(i)));
    append(beyond, piece(static_cast<std::uint8_t>(i == 4 ? 16 : 0), parity(i)));
  }
  write("fragments", "parity", repaired);
  write("fragments", "parity_too_little", beyond);
  write("udp_frames", "parity", repaired);

  Bytes waited;
  for (std::uint32_t id = 1; id <= 3; ++id) {
    const test::Frame each = test::make_frame(16, 12, id);
    const auto datagrams = test::datagrams_of(each, 400, id);
    for (std::size_t i = 0; i < datagrams.size(); ++i) {
      if (id != 1 || i != 1)
        append(waited, piece(static_cast<std::uint8_t>(i == 0 ? 33 : 2), datagrams[i]));
    }
  }
  Bytes late = test::datagrams_of(test::make_frame(16, 12, 1), 400, 1)[1];
  late[5] |= std::byte{protocol::kFragmentResent};
  append(waited, piece(20, late));
  write("fragments", "waiting", waited);
}

void make_session_seeds() {
  // The target corrects the MACs and knows the key of zeros.
  auto mac = std::move(*protocol::SessionMac::create());
  const protocol::SharedKey shared = protocol::make_shared_key({}, mac);
  const auto datagram = [&](protocol::SessionKind kind, std::uint64_t counter, const Bytes& body) {
    Bytes out(protocol::kSessionHeaderBytes + body.size() + protocol::kSessionTagBytes);
    std::copy(body.begin(), body.end(), out.begin() + protocol::kSessionHeaderBytes);
    mac.set_key(shared.open_key);
    static_cast<void>(mac.seal({kind, shared.id, 7, counter}, out, body.size()));
    return out;
  };
  const Bytes open = datagram(protocol::SessionKind::open, 3, {});
  const Bytes frame = datagram(protocol::SessionKind::host_frame, 1500, host_frame(1));
  write("host_sessions", "openings", joined({piece(0, open), piece(2, open), piece(4, open)}));
  write("host_sessions", "frames",
        joined({piece(1, host_frame(0)), piece(1, host_frame(2)), piece(4, frame), piece(4, frame),
                piece(2, frame), piece(0, frame), piece(0, host_frame(0))}));
  write("host_sessions", "answers",
        joined({piece(2, datagram(protocol::SessionKind::challenge, 1, Bytes(17))), piece(1, {}),
                piece(4, datagram(protocol::SessionKind::answer, 1, host_frame(0)))}));
}

void make_fragment_seeds() {
  Bytes whole;
  Bytes lossy;
  // Two datagrams per message, with other senders in between, taken now and then.
  Bytes in_messages;
  for (std::uint32_t id = 1; id <= 2; ++id) {
    const test::Frame frame = test::make_frame(16, 12, id);
    protocol::Fragmenter::Params params;
    params.stream_id = 1;
    params.frame_id = id;
    params.sim_time_ns = frame.header.sim_time_ns;
    params.row_bytes = 64;
    params.max_payload_bytes = 400;
    const protocol::Fragmenter cut(params, frame.header_bytes, frame.pixels);
    for (std::uint32_t i = 0; i < cut.fragment_count(); ++i) {
      std::array<std::byte, protocol::kFragmentHeaderBytes> memory{};
      const auto pieces = cut.pieces(i, memory);
      Bytes datagram;
      for (std::uint32_t k = 0; k < pieces.count; ++k) append(datagram, pieces.piece[k]);
      const auto instructions = static_cast<std::uint8_t>(i == 0 ? 1 : 2);
      append(whole, piece(instructions, datagram));
      append(in_messages,
             piece(static_cast<std::uint8_t>(instructions | (i % 2 == 1 ? 68 : 0)), datagram));
      if (i == 1)
        append(in_messages, piece(static_cast<std::uint8_t>(instructions | 128), datagram));
      if (i != id) append(lossy, piece(static_cast<std::uint8_t>(instructions | 4), datagram));
    }
  }
  write("fragments", "whole", whole);
  make_loss_seeds();
  write("udp_frames", "in_messages", in_messages);
  write("udp_frames", "lossy", lossy);
  write("fragments", "lossy", lossy);
}

/// Writes a log with an image that compresses and one that does not.
/// Writes a log anew with the descriptors in its schemas cut to a few bytes. No reader looks into
/// them, and in a seed of two messages they would take nine mutations out of ten.
void shorten_schemas(const fs::path& log, std::uint32_t chunk_bytes) {
  const fs::path whole = log.string() + ".whole";
  fs::rename(log, whole);
  auto reader = protocol::McapReader::open(whole);
  auto writer = protocol::McapWriter::create(log, {.chunk_bytes = chunk_bytes});
  if (!reader || !writer) std::abort();
  std::map<std::uint16_t, std::uint16_t> channels;
  for (auto more = reader->next(); more && *more; more = reader->next()) {
    const protocol::McapMessage& message = reader->message();
    const protocol::McapChannel& channel = *reader->channel(message.channel_id);
    if (!channels.contains(message.channel_id)) {
      const protocol::McapSchema& schema = *reader->schema(channel.schema_id);
      const auto id = writer->add_schema(schema.name, schema.encoding, schema.data.substr(0, 4));
      if (!id) std::abort();
      const auto added = writer->add_channel(*id, channel.topic, channel.message_encoding);
      if (!added) std::abort();
      channels[message.channel_id] = *added;
    }
    static_cast<void>(writer->write(channels[message.channel_id], message.sequence,
                                    static_cast<std::int64_t>(message.log_time_ns),
                                    static_cast<std::int64_t>(message.publish_time_ns),
                                    message.data));
  }
  static_cast<void>(writer->close());
  fs::remove(whole);
}

void make_image_log_seed() {
  protocol::LogWriterOptions options;
  options.frames = true;
  auto writer = protocol::LogWriter::create(seed("mcap_log", "images.mcap"), options);
  if (!writer) std::abort();
  constexpr std::uint32_t kWidthPx = 8;
  constexpr std::uint32_t kHeightPx = 6;
  for (const bool smooth : {true, false}) {
    std::vector<float> pixels(kWidthPx * kHeightPx, 20.0F);
    for (std::size_t i = 0; i < pixels.size() && !smooth; ++i) {
      pixels[i] = std::bit_cast<float>(static_cast<std::uint32_t>((i + 1) * 2654435761U));
    }
    v1::RecordedFrame image;
    image.set_width_px(kWidthPx);
    image.set_height_px(kHeightPx);
    protocol::PixelEncoder encoder(pixels.size() * sizeof(float));
    protocol::set_pixels(image, pixels, encoder);
    static_cast<void>(writer->write_frame(image, 5'000'000));
  }
  static_cast<void>(writer->close());
  shorten_schemas(seed("mcap_log", "images.mcap"), options.chunk_bytes);
}

void make_log_seeds() {
  for (const auto& [name, chunk_bytes] :
       {std::pair("chunks.mcap", 1024u), std::pair("plain.mcap", 0u)}) {
    protocol::LogWriterOptions options;
    options.chunk_bytes = chunk_bytes;
    auto writer = protocol::LogWriter::create(seed("mcap_log", name), options);
    if (!writer) std::abort();
    const auto frame = test::make_host_frame(1);
    for (std::uint64_t i = 1; i <= 2; ++i) {
      frame->frame_number = i;
      static_cast<void>(writer->write_host(*frame, static_cast<std::int64_t>(i) * 5'000'000));
      static_cast<void>(writer->write_journal(decision()));
    }
    static_cast<void>(writer->close());
    shorten_schemas(seed("mcap_log", name), chunk_bytes);
  }
  make_image_log_seed();
}

Bytes ipv4_udp(const Bytes& payload) {
  const auto size = [](std::size_t bytes) { return static_cast<std::uint16_t>(bytes); };
  Bytes out;
  append_number(out, std::uint16_t{0x4500}, true);
  append_number(out, size(28 + payload.size()), true);
  append_number(out, std::uint32_t{0x00074000}, true);
  append_number(out, std::uint32_t{0x40110000}, true);
  append_number(out, std::uint32_t{0x7F000001}, true);
  append_number(out, std::uint32_t{0x7F000001}, true);
  append_number(out, std::uint16_t{40000}, true);
  append_number(out, std::uint16_t{7001}, true);
  append_number(out, size(8 + payload.size()), true);
  append_number(out, std::uint16_t{0}, true);
  append(out, payload);
  return out;
}

void make_capture_seeds() {
  const Bytes packet = ipv4_udp(host_frame(1));
  Bytes pcap;
  for (const std::uint32_t word : {0xA1B2C3D4u, 0x00040002u, 0u, 0u, 262144u, 101u}) {
    append_number(pcap, word);
  }
  for (std::uint32_t i = 0; i < 2; ++i) {
    for (const std::uint32_t word : {1'700'000'000u, i, 0u, 0u}) append_number(pcap, word);
    const auto bytes = static_cast<std::uint32_t>(packet.size());
    std::memcpy(pcap.data() + pcap.size() - 8, &bytes, 4);
    std::memcpy(pcap.data() + pcap.size() - 4, &bytes, 4);
    append(pcap, packet);
  }
  write("pose_pcap", "raw.pcap", pcap);

  Bytes pcapng;
  const auto block = [&pcapng](std::uint32_t type, Bytes content) {
    content.resize((content.size() + 3) / 4 * 4);
    const auto bytes = static_cast<std::uint32_t>(content.size() + 12);
    append_number(pcapng, type);
    append_number(pcapng, bytes);
    append(pcapng, content);
    append_number(pcapng, bytes);
  };
  const auto words = [](std::initializer_list<std::uint32_t> values) {
    Bytes out;
    for (const std::uint32_t value : values) append_number(out, value);
    return out;
  };
  block(0x0A0D0D0A, words({0x1A2B3C4D, 1, ~0u, ~0u}));
  block(1, words({101, 0}));
  const auto bytes = static_cast<std::uint32_t>(packet.size());
  block(6, joined({words({0, 0x50000, 0x1234, bytes, bytes}), packet}));
  write("pose_pcap", "raw.pcapng", pcapng);
}

void make_image_seeds() {
  image::ExrImage picture;
  picture.width_px = 8;
  picture.height_px = 6;
  std::vector<float> pixels(48);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<float>(i) * 0.25F;
  picture.add(image::kRadianceChannel, pixels);
  picture.add(image::kTemperatureChannel, pixels);
  image::FrameMetadata metadata;
  metadata.frame_number = 42;
  metadata.band_name = "8-12";
  metadata.band_lo_um = 8.0;
  metadata.band_hi_um = 12.0;
  metadata.band_response = {{8.0, 0.5}, {10.0, 1.0}, {12.0, 0.5}};
  image::set_frame_metadata(picture, metadata);
  if (!image::write_exr(seed("exr", "frame.exr"), picture)) std::abort();
}

void make_scene_seeds() {
  scenegen::GenerateOptions options;
  options.kind = scenegen::SceneKind::box;
  options.directory = seed("gltf", "");
  if (!scenegen::generate(options)) std::abort();
}

void make_state_seeds() {
  const scene::SceneGeometry geometry = fuzz::state_geometry();
  renderer::SurfaceModel model;
  renderer::SurfaceModelOptions options;
  model.meshes.emplace_back(geometry.meshes[0], options.max_samples);
  static_cast<void>(model.meshes[0].split(std::vector<std::uint32_t>{0, 3}));
  model.drawn_samples = static_cast<std::uint32_t>(model.meshes[0].vertices().size());
  model.first_sample = {0};
  model.samples.first_twin = model.drawn_samples;
  for (std::uint32_t i = 0; i < model.drawn_samples; ++i) {
    renderer::SurfaceSample sample;
    sample.material = i % 3;
    sample.entity = -1;
    sample.first_seen = i;
    sample.seen_count = 1;
    sample.seen_scale = 1.0F;
    sample.vertex = i;
    model.samples.samples.push_back(sample);
    model.samples.seen.push_back({model.drawn_samples - 1 - i, 0.5F});
    model.states.emplace_back();
    model.outputs.emplace_back();
  }
  const std::vector<float> value_k(model.drawn_samples, 1.0F);
  model.drawn = renderer::drawn_meshes(
      {renderer::refined_copy(geometry.meshes[0], model.meshes[0], geometry.materials)},
      std::vector<renderer::VertexValues>{{value_k}});
  model.eyes = {{{1.0, -2.0, 3.0}, {0.0, 1.0, 0.0}}};
  if (!renderer::write_state(seed("state_file", "split.emitstate"), fuzz::state_key(), model)) {
    std::abort();
  }
}

void make_axes_seeds() {
  protocol::AxesCodec codec;
  protocol::AxesCommand command;
  command.counter = 1000;
  command.time_ns = 1'800'000'000'000'000'005;
  command.sim_time_ns = 12'500'000'000;
  command.period_us = 1000;
  command.mode = protocol::AxesMode::follow;
  command.count = protocol::kMaxAxes;
  for (protocol::AxisMotion& axis : command.axes) axis = {0.25, -1.5, 20.0};
  const auto keep = [](const char* name, std::span<const std::byte> bytes) {
    write("axes", name, Bytes(bytes.begin(), bytes.end()));
  };
  keep("follow", codec.encode(command));
  command.mode = protocol::AxesMode::park;
  command.count = 0;
  keep("park", codec.encode(command));
  protocol::AxesMonitor monitor;
  monitor.counter = 3;
  monitor.command_counter = 1000;
  monitor.state = protocol::AxesState::following;
  monitor.limited_axes = 5;
  monitor.count = 3;
  monitor.measured.fill({0.25, -1.5, 20.0});
  monitor.demanded.fill({0.26, -1.5, 20.0});
  keep("monitor", codec.encode(monitor));

  // The same as blocks of memory.
  command.mode = protocol::AxesMode::follow;
  command.count = protocol::kMaxAxes;
  std::array<std::uint64_t, protocol::kAxesCommandWords> command_words{};
  protocol::store_axes(std::span(command_words), command);
  std::array<std::uint64_t, protocol::kAxesMonitorWords> monitor_words{};
  protocol::store_axes(std::span(monitor_words), monitor);
  const auto keep_block = [](const char* name, std::span<const std::uint64_t> words) {
    const auto bytes = std::as_bytes(words);
    write("axes_memory", name, Bytes(bytes.begin(), bytes.end()));
  };
  keep_block("follow", command_words);
  keep_block("monitor", monitor_words);
  command_words.front() += 1;
  keep_block("torn", command_words);
}

void make_cigi_seeds() {
  using protocol::cigi::ByteOrder;
  using protocol::cigi::Version;
  for (const auto& [name, order] :
       {std::pair("big", ByteOrder::big), std::pair("little", ByteOrder::little)}) {
    for (const auto& [number, version] :
         {std::pair("", Version::v3_3), std::pair("_v4", Version::v4_0)}) {
      const std::string end = std::string(number) + "_" + name;
      write("cigi", ("host" + end).c_str(),
            test::cigi_message(test::sample_host_packets(version), order, version));
      write("cigi", ("ig" + end).c_str(),
            test::cigi_message(test::sample_ig_packets(version), order, version));
    }
  }
}

void make_dis_seeds() {
  const auto samples = test::sample_pdus();
  write("dis", "bundle_v6", test::dis_datagram(samples, 6));
  write("dis", "bundle_v7", test::dis_datagram(samples, 7));
  const char* names[] = {"state", "fire", "detonation", "start", "stop", "update"};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    write("dis", names[i], test::dis_datagram(std::span(&samples[i], 1), 7));
  }
}

void make_net_fdm_seeds() {
  Bytes bytes(protocol::net_fdm::kBytes);
  protocol::net_fdm::encode({.longitude_rad = 0.125,
                             .latitude_rad = 0.75,
                             .altitude_m = 900.0,
                             .heading_rad = 1.5f,
                             .heading_rate_rad_s = 0.25f,
                             .velocity_ned_m_s = {100.0, -20.0, 3.0},
                             .pilot_specific_force_m_s2 = {0.0, 0.0, -9.75},
                             .unix_time_s = 1'700'000'000},
                            std::span(bytes).first<protocol::net_fdm::kBytes>());
  write("net_fdm", "flight", bytes);
  bytes[3] = std::byte{25};
  write("net_fdm", "short_version_25", bytes);
  bytes.insert(bytes.begin() + protocol::net_fdm::kTanksAt,
               protocol::net_fdm::kTankBytes - protocol::net_fdm::kBytes, std::byte{0});
  write("net_fdm", "version_25", bytes);
}

void make_trigger_seeds() {
  for (const auto& [name, trigger] :
       {std::pair("stamped",
                  protocol::Trigger{0x1122334455667788, 1000, 1'800'000'000'000'000'005}),
        std::pair("plain", protocol::Trigger{1, 1, 0})}) {
    Bytes bytes(protocol::kTriggerBytes);
    protocol::encode(trigger, std::span(bytes).first<protocol::kTriggerBytes>());
    write("trigger", name, bytes);
  }
  const protocol::SessionKey key{};  // the key of the target
  auto seal = protocol::TriggerSeal::create(std::span(&key, 1));
  Bytes sealed(protocol::kSealedTriggerBytes);
  if (!seal || !seal->seal({2, 3, 1'800'000'000'000'000'005},
                           std::span(sealed).first<protocol::kSealedTriggerBytes>())) {
    std::abort();
  }
  write("trigger", "sealed", sealed);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  root = argv[1];
  make_network_seeds();
  make_loss_seeds();
  make_trigger_seeds();
  make_cigi_seeds();
  make_dis_seeds();
  make_net_fdm_seeds();
  make_axes_seeds();
  make_session_seeds();
  make_fragment_seeds();
  make_log_seeds();
  make_capture_seeds();
  make_image_seeds();
  make_scene_seeds();
  make_state_seeds();
  return 0;
}
