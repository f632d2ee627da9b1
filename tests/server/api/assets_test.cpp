// Files that the build has compressed, as answers (RFC 9110, sections 8.4 and 12.5.3).
#include "server/api/routes/assets.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <stdexcept>
#include <string>

namespace server::api {
namespace {

std::string gzip(const std::string& text) {
  z_stream stream{};
  if (deflateInit2(&stream, 9, Z_DEFLATED, MAX_WBITS + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK) throw std::bad_alloc{};
  std::string in = text;
  std::string out(text.size() + 100, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(in.data());
  stream.avail_in = static_cast<uInt>(in.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

struct Assets : testing::Test {
  const std::string text = "export const station = 'station station station';";
  const std::string bytes = gzip(text);
  base::EmbeddedFile script{"/assets/index-1.js.gz", bytes, "abc"};

  http::Response asked(const std::string& accepted, const std::string& etag = "") const {
    http::Request request;
    request.method = "GET";
    if (!accepted.empty()) request.headers["accept-encoding"] = accepted;
    if (!etag.empty()) request.headers["if-none-match"] = etag;
    return asset_response(request, script);
  }

  static std::string field(const http::Response& response, const std::string& name) {
    for (const auto& [key, value] : response.headers) {
      if (key == name) return value;
    }
    return "";
  }
};

TEST_F(Assets, WhoTakesGzipHasTheFileAsItIs) {
  for (const char* accepted : {"gzip", "gzip, deflate, br", "br, gzip;q=0.5", "*", "deflate;q=1 , gzip"}) {
    const http::Response answer = asked(accepted);
    EXPECT_EQ(answer.body, bytes) << accepted;
    EXPECT_EQ(field(answer, "Content-Encoding"), "gzip") << accepted;
    EXPECT_EQ(field(answer, "Vary"), "Accept-Encoding");
    EXPECT_EQ(answer.content_type, "text/javascript; charset=utf-8");
    EXPECT_NE(field(answer, "Cache-Control").find("immutable"), std::string::npos);
  }
}

TEST_F(Assets, EverybodyElseHasItExpanded) {
  for (const char* accepted :
       {"", "identity", "br", "gzip;q=0", "gzip; q=0.000, br", "*;q=0", "gzip;q=0, *", "notgzip"}) {
    const http::Response answer = asked(accepted);
    EXPECT_EQ(answer.body, text) << accepted;
    EXPECT_EQ(field(answer, "Content-Encoding"), "") << accepted;
    EXPECT_EQ(field(answer, "Vary"), "Accept-Encoding");
  }
}

TEST_F(Assets, TheTwoFormsHaveDifferentETags) {
  const std::string compressed = field(asked("gzip"), "ETag");
  const std::string plain = field(asked(""), "ETag");
  EXPECT_NE(compressed, plain);
  EXPECT_EQ(asked("gzip", compressed).status, 304);
  EXPECT_EQ(asked("", plain).status, 304);
  EXPECT_EQ(asked("gzip", plain).status, 200);
  EXPECT_EQ(asked("", compressed).status, 200);
}

TEST_F(Assets, AnEmptyTextStaysEmpty) {
  const std::string nothing = gzip("");
  script.content = nothing;
  EXPECT_EQ(asked("").body, "");
}

TEST_F(Assets, AFileThatIsNotCompressedIsAnsweredAsItIs) {
  script = {"/favicon.ico", "bytes", "abc"};
  const http::Response answer = asked("gzip");
  EXPECT_EQ(answer.body, "bytes");
  EXPECT_EQ(field(answer, "Content-Encoding"), "");
  EXPECT_EQ(field(answer, "Vary"), "");
  EXPECT_EQ(field(answer, "Cache-Control"), "no-cache");
}

TEST_F(Assets, ADamagedFileIsNotSent) {
  std::string damaged = bytes;
  damaged[12] = static_cast<char>(damaged[12] ^ 0x55);
  script.content = damaged;
  EXPECT_THROW(asked(""), std::logic_error);
}

// The cockpit itself, as a client without gzip reads it.
TEST_F(Assets, EveryTextOfTheCockpitExpands) {
  for (const base::EmbeddedFile& file : cockpit_files()) {
    if (!file.name.ends_with(".gz")) continue;
    EXPECT_GT(asset_response(http::Request{}, file).body.size(), 0U) << file.name;
  }
}

}  // namespace
}  // namespace server::api
