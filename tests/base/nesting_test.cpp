// How deep a text may be nested: found before it is parsed, and what is not refused needs little stack.
#include "base/nesting.hpp"

#include <gtest/gtest.h>
#include <pthread.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "base/toml_text.hpp"

namespace base {
namespace {

std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}

// In a thread with 256 kB of stack; what needs more ends the test.
void on_a_small_stack(const std::function<void()>& work) {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  ASSERT_EQ(pthread_attr_setstacksize(&attributes, 256 << 10), 0);
  pthread_t thread{};
  const auto run = [](void* what) -> void* {
    (*static_cast<const std::function<void()>*>(what))();
    return nullptr;
  };
  ASSERT_EQ(pthread_create(&thread, &attributes, run, const_cast<std::function<void()>*>(&work)), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
}

TEST(Nesting, OfTomlCountsHeadersDottedKeysAndValuesInEachOther) {
  EXPECT_FALSE(is_toml_deeper("a = 1\n[b]\nc.d = 1.5\n[[e]]\nf = [[1.5, 2.5], [3.25]]\n", 6));
  EXPECT_FALSE(is_toml_deeper("a = [" + repeated("1.5, ", 1000) + "]", 4)) << "points of numbers";
  EXPECT_FALSE(is_toml_deeper(repeated("a.b = 1.5\n", 1000), 4));
  EXPECT_FALSE(is_toml_deeper(repeated("[a.b]\nc = 1\n", 1000), 6));
  EXPECT_FALSE(is_toml_deeper("a = \"" + repeated(".", 1000) + repeated("[", 1000) + "\" # [[[[[[[\n", 4)) << "texts";
  EXPECT_FALSE(is_toml_deeper("a = '''\n" + repeated("[[[\n", 100) + "'''\nb = \"\"\"\\\"\"\"[[[[[[[[\"\"\"", 4));
  EXPECT_FALSE(is_toml_deeper("a = 1979-05-27T00:32:00.999 # a.b.c.d.e.f.g", 4));
  EXPECT_TRUE(is_toml_deeper(repeated("a.", 40) + "a = 1", 32));
  EXPECT_TRUE(is_toml_deeper(repeated("a . ", 40) + "a = 1", 32));
  EXPECT_TRUE(is_toml_deeper(repeated("'a'.\"b\".", 20) + "a = 1", 32));
  EXPECT_TRUE(is_toml_deeper("[" + repeated("a.", 40) + "a]", 32));
  EXPECT_TRUE(is_toml_deeper("[[" + repeated("a.", 40) + "a]]", 32));
  EXPECT_TRUE(is_toml_deeper("a = " + repeated("[", 40), 32));
  EXPECT_TRUE(is_toml_deeper("a = " + repeated("{ a.b = ", 20), 32));
  EXPECT_TRUE(is_toml_deeper("[" + repeated("a.", 15) + "a]\n" + repeated("a.", 20) + "a = 1", 32));
}

// A string of three quotes may end with one or two more, which are of it.
TEST(Nesting, OfTomlIsNotHiddenByQuotes) {
  const std::string deep = "{" + repeated("a.", 40) + "a = 1}";
  for (const char* text : {"'''x''''", "'''x'''''", "\"\"\"x\"\"\"\"", "\"\"\"x\"\"\"\"\"", "''''''", "\"\"\"\"\"\"",
                           "''", "\"\"", "\"\"\"\\\"\"\"\"\"", "\"\\\\\""}) {
    EXPECT_TRUE(is_toml_deeper(std::string{"x = ["} + text + ", " + deep + "]", 32)) << text;
    EXPECT_FALSE(is_toml_deeper(std::string{"x = ["} + text + ", 1.5]", 4)) << text;
    EXPECT_NO_THROW(static_cast<void>(parse_toml(std::string{"x = ["} + text + "]", "a"))) << text;
  }
  EXPECT_TRUE(is_toml_deeper("\xEF\xBB\xBF[" + repeated("a.", 20) + "a]\n" + repeated("b.", 20) + "b = 1", 32));
}

TEST(Nesting, OfJsonCountsListsAndObjects) {
  EXPECT_FALSE(is_json_deeper(R"({"a": [1, {"b": "[[[[[[\"[["}]})", 3));
  EXPECT_TRUE(is_json_deeper(R"({"a": [1, {"b": []}]})", 3));
  EXPECT_TRUE(is_json_deeper(repeated("[", 100000), 64));
}

TEST(Nesting, ADeepDocumentIsRefusedOnASmallStack) {
  on_a_small_stack([] {
    for (const int depth : {10, 31, 33, 1000, 16000, 200000}) {
      for (const std::string& text : {repeated("a.", depth) + "a = 1", "[" + repeated("a.", depth) + "a]\nb = 1",
                                      "a = " + repeated("[", depth) + repeated("]", depth),
                                      "a = " + repeated("{ a = ", depth) + "1" + repeated("}", depth)}) {
        try {
          toml::table table = parse_toml(text, "a");
          const toml::table copy = table;
          EXPECT_LT(depth, 33);
          EXPECT_FALSE(copy.empty());
        } catch (const std::invalid_argument&) {
          EXPECT_GT(depth, 30);
        }
      }
    }
  });
}

// What is not refused, whatever it is, parses or fails on a small stack.
TEST(Nesting, NoTextOfTheseLettersNeedsMoreStack) {
  on_a_small_stack([] {
    std::mt19937 random{7};
    const std::string letters = "a.[]{}=,\"'\n #1\\";
    for (int text_number = 0; text_number < 3000; ++text_number) {
      std::string text;
      const bool is_deep = text_number % 3 == 0;
      for (int i = 0; i < 400; ++i) {
        const char letter = letters[random() % letters.size()];
        if (random() % 16 == 0) text += random() % 2 == 0 ? "'''" : "\"\"\"";
        text += is_deep && random() % 4 != 0 ? std::string(1, "a.[{"[random() % 4]) : std::string(1, letter);
      }
      try {
        static_cast<void>(parse_toml(text, "a"));
      } catch (const std::invalid_argument&) {
      }
      if (!is_json_deeper(text, kMostJsonDepth)) static_cast<void>(nlohmann::json::parse(text, nullptr, false));
    }
  });
}

}  // namespace
}  // namespace base
