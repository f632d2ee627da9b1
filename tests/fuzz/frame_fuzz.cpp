// Feeds any bytes to the frame reader and both decoders: what decodes must encode, and decode to the same again.
#include <cstdlib>
#include <vector>

#include "protocol/frame.hpp"
#include "tests/fuzz/targets.hpp"

namespace protocol {
namespace {

using ByteVector = std::vector<std::uint8_t>;

template <class Frame>
ByteVector encoded(const Frame& frame) {
  ByteVector bytes(kMaxFrameBytes);
  bytes.resize(encode(frame, bytes.data(), bytes.size()));
  if (bytes.empty()) std::abort();
  return bytes;
}

template <class Decode>
void decode_twice(Bytes payload, Decode decode_frame) {
  const auto frame = decode_frame(payload);
  if (!frame) return;
  const ByteVector bytes = encoded(*frame);
  const auto again = decode_frame({bytes.data(), bytes.size()});
  if (!again || encoded(*again) != bytes) std::abort();
}

}  // namespace
}  // namespace protocol

int fuzz::frame(const std::uint8_t* data, std::size_t size) {
  protocol::FrameReader reader;
  protocol::Bytes input{data, size};
  while (!input.empty()) {
    if (reader.push(input) != protocol::FrameReader::State::complete) break;
    protocol::decode_twice(reader.payload(),
                           [](protocol::Bytes payload) { return protocol::decode_robot_frame(payload); });
    protocol::decode_twice(reader.payload(), protocol::decode_station_frame);
  }
  return 0;
}
