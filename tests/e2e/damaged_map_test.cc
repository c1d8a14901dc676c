// SPDX-License-Identifier: Apache-2.0
// A map file with a flipped byte: its map is refused or found out, and the others are served.
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/support/programs.h"

namespace loci {
namespace {

using testing::AnyOf;
using testing::HasSubstr;
using testing::Not;

class DamagedMapTest : public ProgramsTest {
 protected:
  DamagedMapTest() {
    const std::string log = WriteOfficeLog(Path("log"), 120);
    StartServer();
    Stream(log, "whole");
    Stream(log, "damaged");
    digest_ = OutcomeOf("damaged").digest;
    EXPECT_EQ(server().End(SIGTERM), 0);
    std::filesystem::copy_file(file(), Path("kept"));
  }

  std::filesystem::path file() const { return Path("maps") / "damaged.loci"; }
  const std::string& digest() const { return digest_; }

  void FlipByte(std::uint64_t offset) {
    std::filesystem::copy_file(
        Path("kept"), file(), std::filesystem::copy_options::overwrite_existing);
    std::fstream bytes(file(), std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekg(static_cast<std::streamoff>(offset));
    const int before = bytes.get();
    bytes.seekp(static_cast<std::streamoff>(offset));
    bytes.put(static_cast<char>(before ^ 0x10));
    ASSERT_TRUE(bytes.good());
  }

  void StartServerAndWait() {
    StartServer();
    const auto recovered = [this] {
      return HttpGet(server().http_port(), "/readyz").status == 200;
    };
    ASSERT_TRUE(Becomes(recovered));
  }

  void ExpectOtherMapServed() {
    EXPECT_EQ(LociJson({"map", "info", "whole"})["state_digest"], digest_);
    EXPECT_EQ(LociJson({"map", "verify", "whole"})["ok"], true);
  }

 private:
  std::string digest_;
};

TEST_F(DamagedMapTest, AFileWithoutItsHeaderIsRefusedWithWhatToDoAndTheOtherMapIsServed) {
  FlipByte(2);  // of "SQLite format 3"
  StartServerAndWait();
  const Ended info = Loci({"map", "info", "damaged"});
  EXPECT_EQ(info.exit_code, 1);
  EXPECT_THAT(info.error, HasSubstr("DATA_LOSS"));
  EXPECT_THAT(info.error, HasSubstr("damaged.loci"));
  EXPECT_THAT(info.error, HasSubstr("backup"));
  const std::string log = (Path("log") / "office.clf").string();
  EXPECT_EQ(Loci({"stream", log, "--map", "damaged"}).exit_code, 1);
  const nlohmann::json status = LociJson({"status"});
  EXPECT_EQ(status["ready"], true);
  for (const nlohmann::json& map : status["maps"]) {
    EXPECT_EQ(map["problem"] == "", map["map"] == "whole") << map;
  }
  for (const Ended& listed : {Loci({"status"}), Loci({"map", "list"})}) {
    EXPECT_THAT(listed.out, HasSubstr("DATA_LOSS: map \"damaged\" is refused: "));
    EXPECT_THAT(listed.out, Not(HasSubstr("refused: DATA_LOSS")));
  }
  ExpectOtherMapServed();
}

TEST_F(DamagedMapTest, AFlippedByteIsFoundOutOrChangesNothing) {
  constexpr int kFlips = 12;
  RandomSequence random(7);
  int found_out = 0;
  for (int flip = 0; flip < kFlips; ++flip) {
    const std::uint64_t offset = random.NextBits() % std::filesystem::file_size(Path("kept"));
    SCOPED_TRACE("byte " + std::to_string(offset));
    FlipByte(offset);
    StartServerAndWait();
    const Ended verified = Loci({"map", "verify", "damaged", "--json"});
    if (verified.exit_code == 0) {
      // A byte that holds nothing: unused room of a page.
      EXPECT_EQ(LociJson({"map", "info", "damaged"})["state_digest"], digest());
    } else {
      ++found_out;
      EXPECT_EQ(verified.exit_code, 1);
      EXPECT_THAT(verified.error, AnyOf(HasSubstr("DATA_LOSS"), HasSubstr("FAILED_PRECONDITION")));
      EXPECT_THAT(verified.error, HasSubstr("damaged"));
    }
    EXPECT_EQ(LociJson({"map", "info", "whole"})["state_digest"], digest());
    EXPECT_EQ(server().End(SIGTERM), 0);
  }
  EXPECT_GT(found_out, kFlips / 2);
}

}  // namespace
}  // namespace loci
