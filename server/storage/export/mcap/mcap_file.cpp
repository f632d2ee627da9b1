// Records as bytes.
#include "server/storage/export/mcap/mcap_file.hpp"

#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <concepts>
#include <system_error>

namespace server::storage {
namespace {

constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
constexpr std::size_t kChunkBytes = 1024 * 1024;  // a chunk ends with the message that reaches this
constexpr std::size_t kHeadBytes = 1 + 8;         // opcode and length

// Opcodes.
constexpr std::uint8_t kHeader = 0x01, kFooter = 0x02, kSchema = 0x03, kChannel = 0x04, kMessage = 0x05, kChunk = 0x06,
                       kMessageIndex = 0x07, kChunkIndex = 0x08, kStatistics = 0x0b, kMetadata = 0x0c,
                       kMetadataIndex = 0x0d, kSummaryOffset = 0x0e, kDataEnd = 0x0f;

template <std::unsigned_integral Number>
void set(char* at, Number value) {
  for (std::size_t byte = 0; byte < sizeof value; ++byte) at[byte] = static_cast<char>(value >> (8 * byte) & 0xff);
}
template <std::unsigned_integral Number>
void put(std::string& out, Number value) {
  char bytes[sizeof value];
  set(bytes, value);
  out.append(bytes, sizeof bytes);
}

void put_text(std::string& out, std::string_view text) {
  put(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

void put_record(std::string& out, std::uint8_t opcode, std::string_view content) {
  put(out, opcode);
  put(out, std::uint64_t{content.size()});
  out += content;
}

std::uint32_t crc_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace

McapFile::McapFile(const std::filesystem::path& path, std::string_view library)
    : file_{::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)} {
  if (file_ < 0) throw std::system_error{errno, std::generic_category(), "cannot write " + path.string()};
  chunk_.reserve(kChunkBytes + kChunkBytes / 8);
  std::string header, out{kMagic};
  put_text(header, "");  // no profile
  put_text(header, library);
  put_record(out, kHeader, header);
  write(out);
}

McapFile::~McapFile() {
  if (file_ >= 0) ::close(file_);
}

void McapFile::write(std::string_view bytes) {
  position_ += bytes.size();
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw std::system_error{errno, std::generic_category(), "cannot write an export"};
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

ChannelId McapFile::add_channel(std::string_view topic, std::string_view schema_name, std::string_view json_schema) {
  const ChannelId id = ++last_channel_;  // of the schema too
  std::string schema, channel, out;
  put(schema, id);
  put_text(schema, schema_name);
  put_text(schema, "jsonschema");
  put_text(schema, json_schema);
  put(channel, id);
  put(channel, id);
  put_text(channel, topic);
  put_text(channel, "json");
  put_text(channel, "");  // an empty map
  put_record(schemas_, kSchema, schema);
  put_record(channels_, kChannel, channel);
  put_record(out, kSchema, schema);
  put_record(out, kChannel, channel);
  write(out);
  return id;
}

std::string& McapFile::begin_message(const MessagePlace& place) {
  const std::uint64_t time_ns = place.log_time_ns;
  chunk_start_ns_ = chunk_.empty() ? time_ns : std::min(chunk_start_ns_, time_ns);
  chunk_end_ns_ = chunk_.empty() ? time_ns : std::max(chunk_end_ns_, time_ns);
  first_ns_ = messages_ == 0 ? time_ns : std::min(first_ns_, time_ns);
  last_ns_ = std::max(last_ns_, time_ns);
  ++messages_;
  ++counts_[place.channel];
  indexed_[place.channel].push_back({time_ns, chunk_.size()});
  message_begin_ = chunk_.size();
  put(chunk_, kMessage);
  put(chunk_, std::uint64_t{0});  // its length, later
  put(chunk_, place.channel);
  put(chunk_, place.sequence);
  put(chunk_, time_ns);
  put(chunk_, place.publish_time_ns);
  return chunk_;
}

void McapFile::end_message() {
  set(chunk_.data() + message_begin_ + 1, std::uint64_t{chunk_.size() - message_begin_ - kHeadBytes});
  if (chunk_.size() >= kChunkBytes) end_chunk();
}

void McapFile::end_chunk() {
  if (chunk_.empty()) return;
  std::string head;
  put(head, chunk_start_ns_);
  put(head, chunk_end_ns_);
  put(head, std::uint64_t{chunk_.size()});
  put(head, crc_of(chunk_));
  put_text(head, "");  // not compressed
  put(head, std::uint64_t{chunk_.size()});
  std::string record;
  put(record, kChunk);
  put(record, std::uint64_t{head.size() + chunk_.size()});
  record += head;
  const std::uint64_t chunk_begin = position_;
  write(record);
  write(chunk_);
  const std::uint64_t indexes_begin = position_;

  std::string indexes, offsets;
  for (auto& [channel, messages] : indexed_) {
    put(offsets, channel);
    put(offsets, std::uint64_t{indexes_begin + indexes.size()});
    std::string index;
    put(index, channel);
    put(index, static_cast<std::uint32_t>(16 * messages.size()));
    for (const IndexedMessage& message : messages) {
      put(index, message.log_time_ns);
      put(index, message.offset);
    }
    put_record(indexes, kMessageIndex, index);
  }
  write(indexes);

  std::string index;
  put(index, chunk_start_ns_);
  put(index, chunk_end_ns_);
  put(index, chunk_begin);
  put(index, std::uint64_t{indexes_begin - chunk_begin});
  put_text(index, offsets);
  put(index, std::uint64_t{indexes.size()});
  put_text(index, "");
  put(index, std::uint64_t{chunk_.size()});
  put(index, std::uint64_t{chunk_.size()});
  put_record(chunk_indexes_, kChunkIndex, index);
  ++chunks_;
  chunk_.clear();
  indexed_.clear();
}

void McapFile::add_metadata(std::string_view name, const Texts& texts) {
  end_chunk();
  std::string map, content, record, index;
  for (const auto& [key, value] : texts) {
    put_text(map, key);
    put_text(map, value);
  }
  put_text(content, name);
  put_text(content, map);
  put_record(record, kMetadata, content);
  put(index, position_);
  put(index, std::uint64_t{record.size()});
  put_text(index, name);
  put_record(metadata_indexes_, kMetadataIndex, index);
  ++metadata_;
  write(record);
}

// All records of the summary, where it will stand.
std::string McapFile::summary() {
  std::string counts, statistics;
  for (const auto& [channel, count] : counts_) {
    put(counts, channel);
    put(counts, count);
  }
  put(statistics, messages_);
  put(statistics, last_channel_);  // schemas
  put(statistics, std::uint32_t{last_channel_});
  put(statistics, std::uint32_t{0});  // attachments
  put(statistics, metadata_);
  put(statistics, chunks_);
  put(statistics, first_ns_);
  put(statistics, last_ns_);
  put_text(statistics, counts);
  std::string statistics_record;
  put_record(statistics_record, kStatistics, statistics);

  std::string out, offsets;
  const std::pair<std::uint8_t, std::string_view> groups[] = {{kSchema, schemas_},
                                                              {kChannel, channels_},
                                                              {kStatistics, statistics_record},
                                                              {kChunkIndex, chunk_indexes_},
                                                              {kMetadataIndex, metadata_indexes_}};
  for (const auto& [opcode, records] : groups) {
    if (records.empty()) continue;
    std::string offset;
    put(offset, opcode);
    put(offset, std::uint64_t{position_ + out.size()});
    put(offset, std::uint64_t{records.size()});
    put_record(offsets, kSummaryOffset, offset);
    out += records;
  }
  const std::uint64_t offsets_begin = position_ + out.size();
  out += offsets;
  put(out, kFooter);
  put(out, std::uint64_t{8 + 8 + 4});
  put(out, position_);
  put(out, offsets_begin);
  put(out, crc_of(out));
  return out;
}

void McapFile::finish() {
  end_chunk();
  std::string end, crc;
  put(crc, std::uint32_t{0});  // of the data section: none, since each chunk has its own
  put_record(end, kDataEnd, crc);
  write(end);
  write(summary());
  write(kMagic);
  if (::close(std::exchange(file_, -1)) != 0) {
    throw std::system_error{errno, std::generic_category(), "cannot write an export"};
  }
}

}  // namespace server::storage
