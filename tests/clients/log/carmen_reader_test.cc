// SPDX-License-Identifier: Apache-2.0
#include "clients/log/carmen_reader.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include <bzlib.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "core/base/random.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

constexpr double kDegree = kPi / 180.0;

// A file that goes away with the test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary) << bytes;
  }

  const std::string& path() const { return path_; }

 private:
  const TemporaryDirectory directory_;
  const std::string path_ = (directory_.path() / "log.clf").string();
};

std::string Gzip(const std::string& text) {
  z_stream stream = {};
  EXPECT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string input = text;
  std::string output(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(input.data());
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(output.data());
  stream.avail_out = static_cast<uInt>(output.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  output.resize(stream.total_out);
  deflateEnd(&stream);
  return output;
}

std::string Bzip2(const std::string& text) {
  std::string input = text;
  std::string output(text.size() * 2 + 1000, '\0');
  auto size = static_cast<unsigned>(output.size());
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(
                output.data(), &size, input.data(), static_cast<unsigned>(input.size()), 9, 0, 0),
            BZ_OK);
  output.resize(size);
  return output;
}

struct FlaserLine {
  std::vector<double> ranges_m = std::vector<double>(180, 2.0);
  Pose2 world_from_laser;
  Pose2 odom_from_robot;
  std::string stamp = "976052857.337530";
};

std::string ToText(const Pose2& pose) {
  std::array<char, 100> text = {};
  std::snprintf(text.data(), text.size(), " %.6f %.6f %.6f", pose.x, pose.y, pose.theta);
  return text.data();
}

std::string ToText(const FlaserLine& line) {
  std::string text = "FLASER " + std::to_string(line.ranges_m.size());
  for (const double range_m : line.ranges_m) {
    text += " " + std::to_string(range_m);
  }
  return text + ToText(line.world_from_laser) + ToText(line.odom_from_robot) + " " + line.stamp +
         " nohost 18.846177\n";
}

struct Outcome {
  std::vector<LogScan> scans;
  Status status;
  std::size_t skipped = 0;
};

Outcome ReadAll(const std::string& bytes,
                CarmenReaderOptions::OnError on_error = CarmenReaderOptions::OnError::kStop) {
  const TemporaryFile file(bytes);
  Outcome outcome;
  StatusOr<std::unique_ptr<CarmenReader>> reader = CarmenReader::Open(file.path(), {on_error});
  if (!reader.ok()) {
    outcome.status = reader.status();
    return outcome;
  }
  while (true) {
    StatusOr<std::optional<LogScan>> scan = (*reader)->Next();
    if (!scan.ok() || !scan->has_value()) {
      outcome.status = scan.status();
      outcome.skipped = (*reader)->skipped_count();
      return outcome;
    }
    outcome.scans.push_back(std::move(**scan));
  }
}

std::string SmallLog() {
  std::string text = "# a comment\nPARAM robot_frontlaser_offset 0.0 nohost 0\n";
  for (int i = 0; i < 3; ++i) {
    FlaserLine line;
    line.ranges_m = {1.0, 2.5, 81.91, 4.0};
    line.odom_from_robot = {0.1 * i, 0.0, 0.01 * i};
    line.world_from_laser = line.odom_from_robot;
    line.stamp = std::to_string(100 + i) + ".5";
    text += "ODOM 0.1 0.2 0.3 0 0 0 " + line.stamp + " nohost 1.0\n" + ToText(line);
  }
  return text;
}

TEST(CarmenReaderTest, ReadsStampsToTheNanosecondAndRangesToTheMillimetre) {
  FlaserLine line;
  line.ranges_m[0] = 1.2345;
  line.stamp = "976052857.337530123";
  const Outcome outcome = ReadAll(ToText(line));
  ASSERT_TRUE(outcome.status.ok()) << outcome.status.ToString();
  ASSERT_EQ(outcome.scans.size(), 1U);
  EXPECT_EQ(outcome.scans[0].stamp_ns, 976052857337530123);
  EXPECT_EQ(outcome.scans[0].ranges_mm[0], 1235);  // std::to_string: 1.234500
  EXPECT_EQ(outcome.scans[0].line, 1U);
}

TEST(CarmenReaderTest, ReadsTheSameFromPlainGzipAndBzip2WhateverTheName) {
  const std::string log = SmallLog();
  const Outcome plain = ReadAll(log);
  ASSERT_EQ(plain.scans.size(), 3U);
  const std::string half = log.substr(0, log.size() / 2);
  const std::string rest = log.substr(log.size() / 2);
  for (const std::string& bytes :
       {Gzip(log), Bzip2(log), Gzip(half) + Gzip(rest), Bzip2(half) + Bzip2(rest)}) {
    const Outcome packed = ReadAll(bytes);
    ASSERT_TRUE(packed.status.ok()) << packed.status.ToString();
    ASSERT_EQ(packed.scans.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(packed.scans[i].stamp_ns, plain.scans[i].stamp_ns);
      EXPECT_EQ(packed.scans[i].ranges_mm, plain.scans[i].ranges_mm);
    }
  }
}

TEST(CarmenReaderTest, KnowsTheStepOfEveryBeamCountAlsoWhenItChangesWithinALog) {
  const std::vector<std::pair<std::size_t, double>> steps_deg = {
      {180, 1.0}, {181, 1.0}, {360, 0.5}, {361, 0.5}, {90, 2.0}, {721, 0.25}, {1081, 0.25}};
  std::string log;
  for (const auto& [count, step_deg] : steps_deg) {
    FlaserLine line;
    line.ranges_m.assign(count, 3.0);
    log += ToText(line);
  }
  const Outcome outcome = ReadAll(log);
  ASSERT_EQ(outcome.scans.size(), steps_deg.size());
  for (std::size_t i = 0; i < steps_deg.size(); ++i) {
    EXPECT_EQ(outcome.scans[i].ranges_mm.size(), steps_deg[i].first);
    EXPECT_NEAR(outcome.scans[i].angle_step_rad, steps_deg[i].second * kDegree, 1e-12);
    EXPECT_NEAR(outcome.scans[i].angle_min_rad,
                (steps_deg[i].first == 1081 ? -135.0 : -90.0) * kDegree,
                1e-12);
  }
}

// Robot poses on a curve, with the laser's pose as `world_from_laser` tells it.
template <typename Function>
std::string Drive(const Function& world_from_laser, const std::string& begin = "") {
  std::string log = begin;
  for (int i = 0; i < 20; ++i) {
    FlaserLine line;
    line.odom_from_robot = {3.0 + 0.3 * i, 1.0 - 0.1 * i, WrapAngle(2.0 + 0.2 * i)};
    line.world_from_laser = world_from_laser(line.odom_from_robot, i);
    log += ToText(line);
  }
  return log;
}

const std::string kOffsetParam = "PARAM robot_frontlaser_offset 0.25 nohost 0\n";

TEST(CarmenReaderTest, FindsTheLaserOnTheRobotFromTheTwoPosesOfALine) {
  const Pose2 robot_from_laser = {0.31, -0.07, 0.5};
  const auto both = [&](const Pose2& odom, int) { return odom * robot_from_laser; };
  for (const std::string& begin : {std::string(), kOffsetParam}) {
    const Outcome outcome = ReadAll(Drive(both, begin));
    ASSERT_EQ(outcome.scans.size(), 20U);
    EXPECT_NEAR(outcome.scans[5].robot_from_laser.x, 0.31, 1e-5);
    EXPECT_NEAR(outcome.scans[5].robot_from_laser.y, -0.07, 1e-5);
    EXPECT_NEAR(outcome.scans[5].robot_from_laser.theta, 0.5, 1e-5);
  }
}

TEST(CarmenReaderTest, TakesTheOffsetFromParamWhereTheTwoPosesAreOne) {
  const auto equal = [](const Pose2& odom, int) { return odom; };
  EXPECT_EQ(ReadAll(Drive(equal, kOffsetParam)).scans[3].robot_from_laser, (Pose2{0.25, 0.0, 0.0}));
  EXPECT_EQ(ReadAll(Drive(equal)).scans[3].robot_from_laser, Pose2());
}

TEST(CarmenReaderTest, IsNotMisledByALaserPoseThatALocaliserCorrected) {
  const auto corrected = [](const Pose2& odom, int i) {
    return Pose2{0.1 * i, 0.02 * i, -0.05 * i} * odom;
  };
  EXPECT_EQ(ReadAll(Drive(corrected)).scans[3].robot_from_laser, Pose2());
  EXPECT_EQ(ReadAll(Drive(corrected, kOffsetParam)).scans[3].robot_from_laser,
            (Pose2{0.25, 0.0, 0.0}));
}

TEST(CarmenReaderTest, ReadsRobotLaserWithItsOwnGeometryAndTails) {
  const std::string head = "ROBOTLASER1 0 -1.0 2.0 0.5 20.0 0.01 0 5 1.0 20.0 30.0 0 4.5 ";
  const std::string poses = " 1.2 2.0 0.0 1.0 2.0 0.0 ";
  for (const std::string& tail :
       {std::string("0.3 0.1 "), std::string("0.3 0.1 0.2 0.2 "), std::string("0 0 0 0 1e7 ")}) {
    for (const std::string& remissions : {std::string("0"), std::string("2 7 8")}) {
      const Outcome outcome = ReadAll(head + remissions + poses + tail + "1234.5 host 0.1\n");
      ASSERT_TRUE(outcome.status.ok()) << outcome.status.ToString();
      ASSERT_EQ(outcome.scans.size(), 1U);
      const LogScan& scan = outcome.scans[0];
      EXPECT_EQ(scan.stamp_ns, 1234500000000);
      EXPECT_EQ(scan.angle_min_rad, -1.0);
      EXPECT_EQ(scan.angle_step_rad, 0.5);
      EXPECT_EQ(scan.ranges_mm, (std::vector<std::uint16_t>{1000, 65535, 65535, 65535, 4500}));
      EXPECT_NEAR(scan.robot_from_laser.x, 0.2, 1e-12);
      EXPECT_EQ(scan.odom_from_robot, (Pose2{1.0, 2.0, 0.0}));
    }
  }
}

TEST(CarmenReaderTest, CountsOneScanOnceThatIsWrittenAsBothMessages) {
  FlaserLine line;
  line.stamp = "1234.5";
  const Outcome outcome = ReadAll(
      "ROBOTLASER1 0 -1 2 1 20 0.01 0 3 1 2 3 0 0 0 0 0 0 0 0 0 1234.5 host 0.1\n" + ToText(line));
  ASSERT_EQ(outcome.scans.size(), 1U);
  EXPECT_EQ(outcome.scans[0].ranges_mm.size(), 3U);
}

TEST(CarmenReaderTest, TakesOddRangesForNothingSeen) {
  FlaserLine line;
  line.ranges_m = {0.0, -1.0, 81.83, 81.91, 50.0, 51.0, 65.6, 1e9, 0.0001, 49.99};
  const Outcome outcome = ReadAll(ToText(line));
  ASSERT_EQ(outcome.scans.size(), 1U);
  for (std::size_t i = 0; i + 1 < line.ranges_m.size(); ++i) {
    EXPECT_EQ(outcome.scans[0].ranges_mm[i], LogScan::kNothingSeen) << line.ranges_m[i];
  }
  EXPECT_EQ(outcome.scans[0].ranges_mm.back(), 49990);
}

TEST(CarmenReaderTest, FindsALogsOwnMaximumRangeByItsRepetition) {
  RandomSequence random(3);
  std::string far_walls;
  std::string repeated;
  for (int i = 0; i < 30; ++i) {
    FlaserLine line;
    for (double& range_m : line.ranges_m) {
      range_m = random.NextUniform(0.5, 12.0);
    }
    far_walls += ToText(line);
    line.ranges_m[7] = line.ranges_m[8] = line.ranges_m[9] = 12.1;
    repeated += ToText(line);
  }
  EXPECT_EQ(ReadAll(repeated).scans[11].ranges_mm[7], LogScan::kNothingSeen);
  std::size_t nothing = 0;
  for (const LogScan& scan : ReadAll(far_walls).scans) {
    for (const std::uint16_t range_mm : scan.ranges_mm) {
      nothing += range_mm == LogScan::kNothingSeen ? 1 : 0;
    }
  }
  EXPECT_EQ(nothing, 0U);
}

TEST(CarmenReaderTest, NamesFileLineAndFieldOfADamagedLineOrSkipsAndCountsIt) {
  const std::string good = SmallLog();
  for (const std::string& bad : {std::string("FLASER 180 1 2 3\n"),
                                 std::string("FLASER x\n"),
                                 std::string("FLASER 0 1 2\n"),
                                 std::string("FLASER 4097 1 2\n"),
                                 std::string("FLASER 99999999999999999999999 1\n"),
                                 std::string("FLASER -3 1\n"),
                                 std::string("FLASER 1 1 0 0 0 0 nan 0 1.0 h 1\n"),
                                 std::string("FLASER 1 1 0 0 0 0 0 0 -1.0 h 1\n"),
                                 std::string("FLASER 1 1 0 0 0 0 1e400 0 1.0 h 1\n"),
                                 std::string("FLASER 1 1q 0 0 0 0 0 0 1.0 h 1\n"),
                                 std::string("\x01\x02\xff zzz\n"),
                                 std::string("ROBOTLASER1 0 0 0 0 0 0 0 1 1 0 0 0 0\n"),
                                 std::string("ODOM 1 2\n"),
                                 "X" + std::string(LineSource::kLineBytesMax + 10, ' ') + "\n"}) {
    const Outcome stopped = ReadAll(good + bad + good);
    EXPECT_EQ(stopped.status.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(stopped.status.message().find(":9: "), std::string::npos) << stopped.status.message();
    EXPECT_EQ(stopped.scans.size(), 3U);
    const Outcome skipped = ReadAll(good + bad + good, CarmenReaderOptions::OnError::kSkip);
    EXPECT_TRUE(skipped.status.ok());
    EXPECT_EQ(skipped.scans.size(), 6U);
    EXPECT_EQ(skipped.skipped, 1U);
  }
}

TEST(CarmenReaderTest, SaysWhyAFileHoldsNoLog) {
  EXPECT_EQ(CarmenReader::Open("/nowhere/x.clf").status().code(), StatusCode::kNotFound);
  EXPECT_EQ(CarmenReader::Open("/tmp").status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(ReadAll("").status.code(), StatusCode::kInvalidArgument);
  EXPECT_NE(ReadAll("a b c\n").status.message().find("no laser scan"), std::string::npos);
  EXPECT_EQ(ReadAll(Gzip(SmallLog()).substr(0, 15)).status.code(), StatusCode::kDataLoss);
}

TEST(CarmenReaderTest, NeverInventsAScanWhenALogIsCutAtAnyByte) {
  const std::string log = SmallLog();
  const std::vector<LogScan> whole = ReadAll(log).scans;
  for (const auto on_error :
       {CarmenReaderOptions::OnError::kStop, CarmenReaderOptions::OnError::kSkip}) {
    for (std::size_t size = 0; size < log.size(); ++size) {
      const Outcome cut = ReadAll(log.substr(0, size), on_error);
      for (std::size_t i = 0; i < cut.scans.size(); ++i) {
        EXPECT_EQ(cut.scans[i].stamp_ns, whole[i].stamp_ns) << size;
        EXPECT_EQ(cut.scans[i].ranges_mm, whole[i].ranges_mm) << size;
      }
    }
  }
}

TEST(CarmenReaderTest, ReportsACompressedLogThatIsCutAtAnyByte) {
  const std::string log = SmallLog();
  for (const std::string& bytes : {Gzip(log), Bzip2(log)}) {
    for (std::size_t size = 3; size < bytes.size(); ++size) {
      const Outcome cut = ReadAll(bytes.substr(0, size));
      EXPECT_FALSE(cut.status.ok()) << size;
      EXPECT_LE(cut.scans.size(), 3U);
      const Outcome skipped = ReadAll(bytes.substr(0, size), CarmenReaderOptions::OnError::kSkip);
      EXPECT_TRUE(!skipped.status.ok() || skipped.skipped == 1U) << size;
    }
  }
}

// What every scan that is read promises, whatever stood in the file.
void ExpectUsable(const LogScan& scan) {
  EXPECT_GE(scan.stamp_ns, 0);
  EXPECT_GT(scan.angle_step_rad, 0.0);
  EXPECT_FALSE(scan.ranges_mm.empty());
  EXPECT_LE(scan.ranges_mm.size(), 4096U);
  for (const Pose2& pose : {scan.odom_from_robot, scan.robot_from_laser}) {
    EXPECT_TRUE(std::isfinite(pose.x) && std::isfinite(pose.y) && std::isfinite(pose.theta));
  }
}

TEST(CarmenReaderTest, WhatItReadsOfADamagedLogIsUsableAndTheRestIsRefused) {
  const std::string log =
      SmallLog() + "ROBOTLASER1 0 -1 2 1 20 0.01 0 3 1 2 3 0 0 0 0 0 0 0 0 0 104.5 host 0.1\n";
  constexpr std::string_view kBytes = "0123456789.-+eEnaif \n\t#FLRPO\xff";
  RandomSequence random(12);
  std::size_t read = 0;
  std::size_t refused = 0;
  for (int round = 0; round < 1000; ++round) {
    std::string bytes = log;
    for (std::uint64_t i = 0, changes = 1 + random.NextBits() % 6; i < changes; ++i) {
      bytes[random.NextBits() % bytes.size()] = kBytes[random.NextBits() % kBytes.size()];
    }
    const Outcome outcome = ReadAll(bytes, CarmenReaderOptions::OnError::kSkip);
    for (const LogScan& scan : outcome.scans) {
      ExpectUsable(scan);
    }
    read += outcome.scans.size();
    refused += outcome.skipped;
    EXPECT_TRUE(outcome.status.ok() || outcome.status.code() == StatusCode::kInvalidArgument)
        << outcome.status.ToString();
  }
  EXPECT_GT(read, 1000U);
  EXPECT_GT(refused, 500U);
}

TEST(CarmenReaderTest, LivesThroughRandomBytes) {
  RandomSequence random(11);
  const std::string log = SmallLog();
  for (int round = 0; round < 150; ++round) {
    std::string bytes = round % 3 == 0 ? log : round % 3 == 1 ? Gzip(log) : Bzip2(log);
    const auto changes = 1 + random.NextBits() % 40;
    for (std::uint64_t i = 0; i < changes; ++i) {
      bytes[3 + random.NextBits() % (bytes.size() - 3)] = static_cast<char>(random.NextBits());
    }
    ReadAll(bytes);
    ReadAll(bytes, CarmenReaderOptions::OnError::kSkip);
  }
}

}  // namespace
}  // namespace loci
