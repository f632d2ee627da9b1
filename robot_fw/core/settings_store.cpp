// Writes and reads what outlives a reset.
#include "robot_fw/core/settings_store.hpp"

#include <cstring>

#include "robot_fw/core/crc32.hpp"

namespace robot_fw {
namespace {

constexpr std::size_t kWordBytes = 4;
constexpr std::size_t kParameterBytes = kParameterCount * kWordBytes;

static_assert(kParameterBytes + kWordBytes <= Storage::kMaxBytes, "the parameters outgrew a stored value");
static_assert(rheonaut_Controller_size + 16 + kWordBytes <= Storage::kMaxBytes, "a controller outgrew a stored value");

void put_word(std::uint32_t word, std::uint8_t* to) {
  for (std::size_t i = 0; i < kWordBytes; ++i) to[i] = static_cast<std::uint8_t>(word >> (8 * i));
}

std::uint32_t word_at(const std::uint8_t* from) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < kWordBytes; ++i) word |= static_cast<std::uint32_t>(from[i]) << (8 * i);
  return word;
}

std::uint32_t crc_of(const std::uint8_t* bytes, std::size_t size) {
  Crc32 crc;
  crc.add(bytes, size);
  return crc.value();
}

}  // namespace

bool is_kept(Storage& storage, StorageKey key) {
  std::uint8_t bytes[Storage::kMaxBytes];
  return storage.load(key, bytes, sizeof(bytes)) > 0;
}

bool save_parameters(Storage& storage, const Parameters& parameters) {
  std::uint8_t bytes[kParameterBytes + kWordBytes];
  for (std::size_t i = 0; i < kParameterCount; ++i) {
    const float value = parameters.value(i);
    std::uint32_t word = 0;
    std::memcpy(&word, &value, sizeof(word));
    put_word(word, bytes + i * kWordBytes);
  }
  put_word(parameters.checksum(), bytes + kParameterBytes);
  return storage.save(StorageKey::parameters, {bytes, sizeof(bytes)});
}

std::optional<Parameters> load_parameters(Storage& storage) {
  std::uint8_t bytes[Storage::kMaxBytes];
  if (storage.load(StorageKey::parameters, bytes, sizeof(bytes)) != kParameterBytes + kWordBytes) return std::nullopt;
  Parameters parameters;
  for (std::size_t i = 0; i < kParameterCount; ++i) {
    const std::uint32_t word = word_at(bytes + i * kWordBytes);
    float value = 0;
    std::memcpy(&value, &word, sizeof(value));
    if (!Parameters::in_range(i, value)) return std::nullopt;  // SAFETY: no limit that could not have been set
    parameters.set(i, value);
  }
  if (parameters.checksum() != word_at(bytes + kParameterBytes)) return std::nullopt;  // SAFETY: nor one that decayed
  return parameters;
}

bool save_controller(Storage& storage, const protocol::Controller& controller) {
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_controller_tag;
  frame.body.controller = controller;
  std::uint8_t bytes[Storage::kMaxBytes];
  const std::size_t size = protocol::encode(frame, bytes, sizeof(bytes) - kWordBytes);
  if (size == 0) return false;
  put_word(crc_of(bytes, size), bytes + size);
  return storage.save(StorageKey::controller, {bytes, size + kWordBytes});
}

std::optional<protocol::Controller> load_controller(Storage& storage) {
  std::uint8_t bytes[Storage::kMaxBytes];
  const std::size_t size = storage.load(StorageKey::controller, bytes, sizeof(bytes));
  if (size <= kWordBytes || size > sizeof(bytes)) return std::nullopt;
  const std::size_t frame_size = size - kWordBytes;
  if (crc_of(bytes, frame_size) != word_at(bytes + frame_size))
    return std::nullopt;  // SAFETY: nothing that decayed runs
  const auto frame = protocol::decode_robot_frame({bytes, frame_size});
  if (!frame || frame->which_body != rheonaut_RobotFrame_controller_tag) return std::nullopt;
  return frame->body.controller;
}

}  // namespace robot_fw
