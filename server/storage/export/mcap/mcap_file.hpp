// A file of MCAP, version 0: messages of channels in chunks, with an index at the end.
//
//   file     := magic header (schema | channel)* (chunk message_index*)* metadata* data_end summary footer magic
//   magic    := 89 "MCAP0\r\n"                       record := opcode(u8) length(u64) content
//   chunk    := start end size(u64) crc32(u32) "" records        crc32 of the records, which are not compressed
//   message  := channel(u16) sequence(u32) log_time(u64) publish_time(u64) data
//   summary  := schema* channel* statistics chunk_index* metadata_index* summary_offset*
//
// Little-endian; texts and maps begin with their bytes as u32; times are nanoseconds. https://mcap.dev/spec
// A file that breaks off has every finished chunk. Blocks; throws std::system_error when the disk does not take it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace server::storage {

using ChannelId = std::uint16_t;

struct MessagePlace {
  ChannelId channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
};

class McapFile {
 public:
  McapFile(const std::filesystem::path& path, std::string_view library);
  ~McapFile();
  McapFile(const McapFile&) = delete;
  McapFile& operator=(const McapFile&) = delete;

  // Of messages in JSON, before the first of them. `json_schema` is a JSON Schema of an object.
  ChannelId add_channel(std::string_view topic, std::string_view schema_name, std::string_view json_schema);

  // The data of the message is what is appended to the text between these two calls.
  std::string& begin_message(const MessagePlace& place);
  void end_message();

  using Texts = std::vector<std::pair<std::string, std::string>>;  // each name once
  void add_metadata(std::string_view name, const Texts& texts);    // after the last message

  void finish();  // nothing follows

 private:
  struct IndexedMessage {
    std::uint64_t log_time_ns, offset;
  };

  void write(std::string_view bytes);
  void end_chunk();
  std::string summary();

  int file_ = -1;
  std::uint64_t position_ = 0;  // bytes written
  std::string chunk_;           // records of the open chunk
  std::size_t message_begin_ = 0;
  std::uint64_t chunk_start_ns_ = 0, chunk_end_ns_ = 0;
  std::map<ChannelId, std::vector<IndexedMessage>> indexed_;  // of the open chunk

  std::string schemas_, channels_, chunk_indexes_, metadata_indexes_;  // records of the summary
  std::map<ChannelId, std::uint64_t> counts_;
  std::uint64_t first_ns_ = 0, last_ns_ = 0, messages_ = 0;
  std::uint32_t chunks_ = 0, metadata_ = 0;
  ChannelId last_channel_ = 0;
};

}  // namespace server::storage
