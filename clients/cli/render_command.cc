// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/render_command.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/json_output.h"
#include "clients/cli/map_fetch.h"
#include "clients/cli/picture.h"
#include "clients/cli/text_output.h"

namespace loci::cli {
namespace {

constexpr Colour kUnobservedColour = {0xC9, 0xCE, 0xD2};
constexpr Colour kMeshColour = {0x1F, 0x77, 0xB4};
constexpr Colour kScaleColour = {0x20, 0x20, 0x20};
constexpr Colour kWhite = {0xFF, 0xFF, 0xFF};
// Sessions in the order of their first pose; distinct also for most colour-blind readers (Okabe and
// Ito), without the black of walls.
constexpr std::array<Colour, 7> kSessionColours = {{{0xD5, 0x5E, 0x00},
                                                    {0x00, 0x72, 0xB2},
                                                    {0x00, 0x9E, 0x73},
                                                    {0xCC, 0x79, 0xA7},
                                                    {0xE6, 0x9F, 0x00},
                                                    {0x56, 0xB4, 0xE9},
                                                    {0xF0, 0xE4, 0x42}}};
// Cells are log-odds in steps of 0.04.
constexpr double kLogOddsStep = 0.04;

struct RenderOptions {
  std::string map;
  std::string layer = "occupancy";
  std::string out;
  std::uint64_t revision = 0;
  double resolution_m = 0.0;
  std::optional<std::int64_t> zoom;
  bool trajectory = false;
  bool mesh = false;
  bool no_scale = false;
};

class MapPicture {
 public:
  explicit MapPicture(const Raster& raster)
      : raster_(raster), picture_(raster.width, raster.height, kUnobservedColour) {
    std::array<Colour, 256> colours;
    for (int cell = -128; cell < 128; ++cell) {
      const double occupied = 1.0 / (1.0 + std::exp(-kLogOddsStep * cell));
      const auto grey = static_cast<std::uint8_t>(std::lround(255.0 * (1.0 - occupied)));
      colours[static_cast<std::size_t>(cell + 128)] =
          cell == Raster::kUnobserved ? kUnobservedColour : Colour{grey, grey, grey};
    }
    for (std::int32_t row = 0; row < raster.height; ++row) {
      for (std::int32_t column = 0; column < raster.width; ++column) {
        picture_.Set(column,
                     raster.height - 1 - row,
                     colours[static_cast<std::size_t>(raster.at(column, row) + 128)]);
      }
    }
  }

  Picture::Point At(double x_m, double y_m) const {
    return {(x_m - raster_.x_min_m) / raster_.resolution_m,
            raster_.height - (y_m - raster_.y_min_m) / raster_.resolution_m};
  }

  // Pixels of a line that stays visible at every resolution.
  double LineWidth(double width_m) const { return std::max(1.0, width_m / raster_.resolution_m); }

  void DrawTrajectory(const Trajectory& trajectory) {
    std::map<std::string, std::pair<Colour, Picture::Point>> last;
    for (const v1::StampedPose& pose : trajectory.poses) {
      const Picture::Point point = At(pose.map_from_robot().x(), pose.map_from_robot().y());
      const auto found = last.find(pose.session());
      if (found == last.end()) {
        const Colour colour = kSessionColours[last.size() % kSessionColours.size()];
        last.emplace(pose.session(), std::pair{colour, point});
        continue;
      }
      auto& [colour, previous] = found->second;
      // Standing robots give thousands of poses within one pixel.
      if (std::hypot(point.x - previous.x, point.y - previous.y) >= 1.0) {
        picture_.DrawLine(previous, point, LineWidth(0.08), colour, 0.9);
        previous = point;
      }
    }
  }

  void DrawMesh(const v1::Mesh& mesh) {
    const auto vertex = [&](std::uint32_t index) {
      return At(mesh.vertices_m(static_cast<int>(2 * index)),
                mesh.vertices_m(static_cast<int>(2 * index + 1)));
    };
    const auto count = static_cast<std::uint32_t>(mesh.vertices_m_size() / 2);
    for (int i = 0; i + 2 < mesh.ltr_vertices_size(); i += 3) {
      const std::array<std::uint32_t, 3> corners = {
          mesh.ltr_vertices(i), mesh.ltr_vertices(i + 1), mesh.ltr_vertices(i + 2)};
      if (*std::max_element(corners.begin(), corners.end()) >= count) {
        continue;
      }
      for (std::size_t side = 0; side < 3; ++side) {
        picture_.DrawLine(
            vertex(corners[side]), vertex(corners[(side + 1) % 3]), 1.0, kMeshColour, 0.5);
      }
    }
  }

  // A bar of 1, 2 or 5 times a power of ten metres, about a fifth of the picture wide.
  void DrawScale() {
    const double target_m = 0.2 * raster_.width * raster_.resolution_m;
    const double decade = std::pow(10.0, std::floor(std::log10(std::max(target_m, 0.1))));
    const double length_m = decade * (target_m >= 5 * decade ? 5 : target_m >= 2 * decade ? 2 : 1);
    const auto length = static_cast<std::int32_t>(std::lround(length_m / raster_.resolution_m));
    const std::int32_t dot = std::clamp(raster_.width / 400, 1, 6);
    const std::int32_t height = 12 * dot;
    if (length + 8 * dot > raster_.width || height + 2 * dot > raster_.height) {
      return;
    }
    const std::int32_t top = raster_.height - height - dot;
    picture_.FillBox(dot, top, length + 6 * dot, height, kWhite);
    picture_.DrawText(4 * dot, top + dot, dot, NumberText(length_m) + "m", kScaleColour);
    picture_.FillBox(4 * dot, top + 8 * dot, length, dot, kScaleColour);
    picture_.FillBox(4 * dot, top + 7 * dot, dot, 3 * dot, kScaleColour);
    picture_.FillBox(4 * dot + length - dot, top + 7 * dot, dot, 3 * dot, kScaleColour);
  }

  const Picture& picture() const { return picture_; }

 private:
  const Raster& raster_;
  Picture picture_;
};

double ResolutionOf(const RenderOptions& options) {
  constexpr double kPixelAtZoom0M = 12.8;
  return options.zoom.has_value() ? std::ldexp(kPixelAtZoom0M, -static_cast<int>(*options.zoom))
                                  : options.resolution_m;
}

Status Run(Context& context, const RenderOptions& options) {
  LOCI_ASSIGN_OR_RETURN(const Raster raster,
                        FetchRaster(context,
                                    {.map = options.map,
                                     .layer = options.layer,
                                     .resolution_m = ResolutionOf(options),
                                     .revision = options.revision}));
  MapPicture picture(raster);
  // What is drawn over the layer is of the layer's revision, whatever happens meanwhile.
  if (options.mesh) {
    v1::GetMeshRequest request;
    request.set_map(options.map);
    request.set_revision(raster.revision);
    LOCI_ASSIGN_OR_RETURN(const v1::Mesh mesh,
                          context.Call<v1::Mesh>("loci.v1.MapQuery/GetMesh", request));
    picture.DrawMesh(mesh);
  }
  if (options.trajectory) {
    LOCI_ASSIGN_OR_RETURN(const Trajectory trajectory,
                          FetchTrajectory(context, options.map, "", raster.revision));
    picture.DrawTrajectory(trajectory);
  }
  if (!options.no_scale) {
    picture.DrawScale();
  }
  LOCI_RETURN_IF_ERROR(WriteFile(options.out, picture.picture().EncodePng()));
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("out").Value(options.out);
    json.Key("width").Value(std::int64_t{raster.width});
    json.Key("height").Value(std::int64_t{raster.height});
    json.Key("x_min_m").Value(raster.x_min_m).Key("y_min_m").Value(raster.y_min_m);
    json.Key("resolution_m").Value(raster.resolution_m);
    json.Key("revision").Value(raster.revision).EndObject();
    context.out() << json.text() << '\n';
  } else {
    context.out() << "wrote " << raster.width << " x " << raster.height << " pixels of "
                  << NumberText(raster.resolution_m) << " m, revision " << raster.revision
                  << ", to " << options.out << '\n';
  }
  return {};
}

std::vector<Argument> ArgumentsOf(RenderOptions& options) {
  return {{.name = "--map",
           .target = &options.map,
           .help = "Name of the map",
           .required = true,
           .value_name = "MAP"},
          {.name = "--layer",
           .target = &options.layer,
           .help = "The layer: occupancy or moving (default occupancy)",
           .value_name = "LAYER"},
          {.name = "--out",
           .target = &options.out,
           .help = "The PNG file to write",
           .required = true,
           .value_name = "FILE"},
          {.name = "--revision",
           .target = &options.revision,
           .help = "Of this revision, while the server keeps it (default: the newest)"},
          {.name = "--resolution",
           .target = &options.resolution_m,
           .help = "Metres a pixel (default: the layer's)",
           .value_name = "M",
           .check =
               [](const std::string& text) {
                 return !text.empty() && text.front() != '-'
                            ? std::string()
                            : "\"" + text + "\": must be metres, above 0";
               }},
          {.name = "--zoom",
           .target = &options.zoom,
           .help = "The same as the resolution of a zoom of tiles, 0 to 24 (8: 0.05 m)",
           .choices = {"0",  "1",  "2",  "3",  "4",  "5",  "6",  "7",  "8",  "9",  "10", "11", "12",
                       "13", "14", "15", "16", "17", "18", "19", "20", "21", "22", "23", "24"}},
          {.name = "--trajectory",
           .target = &options.trajectory,
           .help = "Draw the ways of the robots, a colour for each session"},
          {.name = "--mesh", .target = &options.mesh, .help = "Draw the LTRs"},
          {.name = "--no-scale", .target = &options.no_scale, .help = "No scale bar"}};
}

}  // namespace

Command MakeRenderCommand() {
  auto options = std::make_shared<RenderOptions>();
  Command command;
  command.name = "render";
  command.help =
      "Write a picture of a layer as PNG. Dark is occupied, light is free, blue-grey is not "
      "observed.";
  command.examples =
      "render --map intel --layer occupancy --out map.png\n"
      "render --map office --out map.png --trajectory --mesh --resolution 0.1";
  command.arguments = ArgumentsOf(*options);
  command.run = [options](Context& context) { return Run(context, *options); };
  return command;
}

}  // namespace loci::cli
