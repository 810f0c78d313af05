// Purpose: mesh files of several formats give one polygon mesh; bad files are refused with path and reason.
#include <catch2/catch.hpp>
#include <cctype>
#include <cstring>
#include <fstream>
#include <numeric>

#include "base/error.hpp"
#include "geometry/mesh_topology.hpp"
#include "io/mesh_reader.hpp"
#include "io/plain_obj.hpp"
#include "io/plain_off.hpp"
#include "io/plain_ply.hpp"
#include "io/plain_stl.hpp"
#include "unit/io/scratch.hpp"

using namespace efsi;
using namespace efsi::io;
using Catch::Matchers::Contains;

namespace {

void write_text(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

geometry::TriangleMesh triangles_of(const PolygonMesh& mesh) {
  std::vector<Vec3d> points;
  for (const auto& p : mesh.points) points.emplace_back(p[0], p[1], p[2]);
  return geometry::triangulate(points, mesh.face_vertex_counts, mesh.face_vertex_indices);
}

const char* const kCubePoints = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n";
const char* const kCubeFaces = "f 1 3 4 2\nf 1 2 6 5\nf 2 4 8 6\nf 4 3 7 8\nf 3 1 5 7\nf 5 6 8 7\n";

// The unit cube as a binary STL: twelve triangles with points of their own.
std::string cube_stl() {
  const int faces[6][4] = {{0, 2, 3, 1}, {0, 1, 5, 4}, {1, 3, 7, 5}, {3, 2, 6, 7}, {2, 0, 4, 6}, {4, 5, 7, 6}};
  std::string bytes(80, ' ');
  const auto append = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  append(std::uint32_t{12});
  for (const auto& face : faces) {
    for (const auto& corners : {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 3}}) {
      for (int n = 0; n < 3; ++n) append(0.0f);
      for (const int corner : corners)
        for (int axis = 0; axis < 3; ++axis) append(static_cast<float>(face[corner] >> axis & 1));
      append(std::uint16_t{0});
    }
  }
  return bytes;
}

std::string base64(const std::string& bytes) {
  const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](std::size_t n) {
      return i + n < bytes.size() ? static_cast<unsigned char>(bytes[i + n]) : 0u;
    };
    const std::uint32_t word = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (int n = 0; n < 4; ++n) text += i + n <= bytes.size() ? digits[word >> (18 - 6 * n) & 63] : '=';
  }
  return text;
}

// A glTF scene with the unit cube under a node moved by (10, 0, 0) whose child scales by (-2, 1, 1).
std::string cube_gltf(
    const std::string& nodes = R"([{"translation":[10,0,0],"children":[1]},{"scale":[-2,1,1],"mesh":0}])") {
  const int faces[6][4] = {{0, 2, 3, 1}, {0, 1, 5, 4}, {1, 3, 7, 5}, {3, 2, 6, 7}, {2, 0, 4, 6}, {4, 5, 7, 6}};
  std::string bytes;
  const auto append = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (int corner = 0; corner < 8; ++corner)
    for (int axis = 0; axis < 3; ++axis) append(static_cast<float>(corner >> axis & 1));
  for (const auto& face : faces)
    for (const int n : {0, 1, 2, 0, 2, 3}) append(static_cast<std::uint16_t>(face[n]));
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
    "nodes":)" +
         nodes + R"(,
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},
                 {"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}],
    "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":96},{"buffer":0,"byteOffset":96,"byteLength":72}],
    "buffers":[{"byteLength":168,"uri":"data:application/octet-stream;base64,)" +
         base64(bytes) + R"("}]})";
}

// Faces of a cube whose points are the n-th eight of a file.
std::string cube_faces(int n) {
  std::string text;
  for (const char* c = kCubeFaces; *c; ++c)
    text += std::isdigit(*c) ? std::to_string(8 * n + *c - '0') : std::string(1, *c);
  return text;
}

// Name and number of faces of each object.
std::vector<std::pair<std::string, std::size_t>> objects_of(const std::string& path) {
  std::vector<std::pair<std::string, std::size_t>> objects;
  std::size_t faces = 0;
  const PolygonMesh mesh = read_mesh(path);
  for (const MeshObject& object : mesh.objects) {
    CHECK(object.first_face == faces);
    faces += object.face_count;
    objects.emplace_back(object.name, object.face_count);
  }
  CHECK(faces == mesh.face_vertex_counts.size());
  return objects;
}

std::string refusal(const std::string& path, ErrorCode code) {
  try {
    read_mesh(path);
  } catch (const Error& error) {
    CHECK(error.code() == code);
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("An OBJ file keeps its polygons, joins split points and leaves lines out") {
  const Scratch scratch;
  write_text(scratch / "cube.obj", std::string(kCubePoints) + kCubeFaces);
  const PolygonMesh cube = read_mesh(scratch / "cube.obj");
  CHECK(cube.points.size() == 8);
  CHECK(cube.face_vertex_counts == std::vector<std::int32_t>(6, 4));
  CHECK(geometry::signed_volume(triangles_of(cube)) == Approx(1.0));

  // Two objects with a common edge, a second copy of its points, and a line.
  write_text(scratch / "two.obj",
             "o first\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no second\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 4 6 5\nl 1 6\n");
  const PolygonMesh two = read_mesh(scratch / "two.obj");
  CHECK(two.points.size() == 4);
  CHECK(two.face_vertex_counts == std::vector<std::int32_t>{3, 3});
}

TEST_CASE("Objects of an OBJ file have its names and faces, also where names repeat, hold spaces or groups") {
  const Scratch scratch;
  using Objects = std::vector<std::pair<std::string, std::size_t>>;
  const std::string points = kCubePoints, faces = cube_faces(0), half = faces.substr(0, faces.size() / 2);
  const auto objects = [&](const std::string& text) {
    write_text(scratch / "objects.obj", text);
    return objects_of(scratch / "objects.obj");
  };
  CHECK(objects(points + faces) == Objects{{"", 6}});
  CHECK(objects("o Big ball \r\n" + points + faces + "\no\tBig_ball\n" + points + cube_faces(1) + "o Big ball\n" +
                points + cube_faces(2)) == Objects{{"Big ball", 6}, {"Big_ball", 6}, {"Big ball", 6}});
  // Groups and materials divide no object; an object without faces is none; o alone has no name.
  CHECK(objects("g before\no Kugel \u00e4\ng top\n" + points + "usemtl a\n" + half + "g bottom\nusemtl b\n" +
                faces.substr(half.size()) + "o empty\no\n" + points + "g top\n" + cube_faces(1)) ==
        Objects{{"Kugel \u00e4", 6}, {"", 6}});
  // The same name again, with another between: assimp would give the last faces to B.
  CHECK(objects("o A\n" + points + half + "o B\n" + points + cube_faces(1) + "o A\n" + faces.substr(half.size())) ==
        Objects{{"A", 3}, {"B", 6}, {"A", 3}});
  // Without objects groups count, as some programs write them.
  CHECK(objects("g default\n" + points + "g pCube1\n" + faces + "g default\n" + points + "g pCube2\n" +
                cube_faces(1)) == Objects{{"pCube1", 6}, {"pCube2", 6}});
  // Words that only begin so are no lines of objects; no line end at the end.
  CHECK(objects("ox\ngood\n" + points + faces + "o last") == Objects{{"", 6}});
  write_text(scratch / "nan.obj", "o 1 bad\nv 0 0 0\nv 1e39 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK_THAT(refusal(scratch / "nan.obj", ErrorCode::kMesh), Contains("point 1 of mesh \"1 bad\" is not finite"));
}

TEST_CASE("Objects of other files are their nodes with faces") {
  const Scratch scratch;
  using Objects = std::vector<std::pair<std::string, std::size_t>>;
  write_text(scratch / "cube.gltf",
             cube_gltf(R"([{"name":"root","children":[1,2]},{"name":"Ball","mesh":0},{"name":"Ball","mesh":0,
                           "translation":[3,0,0]}])"));
  CHECK(objects_of(scratch / "cube.gltf") == Objects{{"Ball", 12}, {"Ball", 12}});
  write_text(scratch / "cube.stl", cube_stl());
  CHECK(objects_of(scratch / "cube.stl") == Objects{{"", 12}});
  write_text(scratch / "one.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  CHECK(objects_of(scratch / "one.off") == Objects{{"", 1}});
}

TEST_CASE("STL, PLY and glTF files give the same closed cube") {
  const Scratch scratch;
  write_text(scratch / "cube.stl", cube_stl());
  write_text(scratch / "cube.ply",
             "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
             "element face 6\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n"
             "4 0 2 3 1\n4 0 1 5 4\n4 1 3 7 5\n4 3 2 6 7\n4 2 0 4 6\n4 4 5 7 6\n");
  for (const char* name : {"cube.stl", "cube.ply"}) {
    const PolygonMesh mesh = read_mesh(scratch / name);
    INFO(name);
    CHECK(mesh.points.size() == 8);
    CHECK(geometry::inspect(triangles_of(mesh)).closed);
    CHECK(geometry::signed_volume(triangles_of(mesh)) == Approx(1.0));
  }
}

TEST_CASE("Transforms of nodes are applied, mirrored meshes keep their outside") {
  const Scratch scratch;
  write_text(scratch / "cube.gltf", cube_gltf());
  const geometry::TriangleMesh mesh = triangles_of(read_mesh(scratch / "cube.gltf"));
  CHECK(geometry::extents(mesh).min == Vec3d(8, 0, 0));
  CHECK(geometry::extents(mesh).max == Vec3d(10, 1, 1));
  CHECK(geometry::signed_volume(mesh) == Approx(2.0));
}

TEST_CASE("A file that is no mesh is refused with path and reason") {
  const Scratch scratch;
  CHECK_THAT(refusal(scratch / "missing.obj", ErrorCode::kIo), Contains("missing.obj: cannot be read: No such file"));
  CHECK_THAT(refusal(scratch / "", ErrorCode::kIo), Contains("is a folder"));
  write_text(scratch / "notes.txt", "not a mesh");
  CHECK_THAT(
      refusal(scratch / "notes.txt", ErrorCode::kMesh),
      Contains("notes.txt: the name of a mesh file must end in one of: obj, ply, stl, off, gltf, glb, fbx, dae, 3ds"));
  write_text(scratch / "empty.obj", "");
  CHECK_THAT(refusal(scratch / "empty.obj", ErrorCode::kMesh), Contains("empty.obj: "));
  write_text(scratch / "cut.stl", cube_stl().substr(0, 300));
  CHECK_THAT(refusal(scratch / "cut.stl", ErrorCode::kMesh), Contains("cut.stl: not a readable .stl file: "));
  write_text(scratch / "points.ply",
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
             "end_header\n0 0 0\n");
  CHECK_THAT(refusal(scratch / "points.ply", ErrorCode::kMesh), Contains("points.ply: "));
  write_text(scratch / "nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK_THAT(refusal(scratch / "nan.obj", ErrorCode::kMesh), Contains("nan.obj: "));
}

TEST_CASE("The suffix decides how a file is read, in upper case too") {
  const Scratch scratch;
  std::string cube = kCubePoints;
  cube += kCubeFaces;
  for (const char* name : {"cube.obj", "cube.OBJ", "two.dots.Obj"}) {
    write_text(scratch / name, cube);
    CHECK(read_mesh(scratch / name).points.size() == 8);
  }
  // A good file under the name of another format is refused, never guessed.
  for (const char* name :
       {"cube.ply", "cube.stl", "cube.off", "cube.gltf", "cube.glb", "cube.fbx", "cube.dae", "cube.3ds"}) {
    write_text(scratch / name, cube);
    CHECK_THAT(refusal(scratch / name, ErrorCode::kMesh), Contains(std::string(name) + ": not a readable ."));
  }
  // Formats that assimp knows and the list does not, and no suffix at all.
  for (const char* name : {"cube.x", "cube.ifc", "cube.blend", "cube", "obj", ".obj"}) {
    write_text(scratch / name, cube);
    CHECK_THAT(refusal(scratch / name, ErrorCode::kMesh), Contains("must end in one of: obj, ply"));
  }
  CHECK_THAT(refusal("/dev/null", ErrorCode::kIo), Contains("is a device or a pipe"));
}

TEST_CASE("A 309-byte OFF file that announces billions of vertices is refused where it ends") {
  const Scratch scratch;
  std::string text = "OFF\n4000000000 12 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n# ";
  text.append(309 - text.size(), '-');
  write_text(scratch / "huge.off", text);
  CHECK_THAT(refusal(scratch / "huge.off", ErrorCode::kMesh), Contains("huge.off: ends before vertex 5 of 4000000000"));
}

TEST_CASE("A file that has less than its header announces is refused where it ends, the shortest whole one is read",
          "[law]") {
  const Scratch scratch;
  // One digit a number, no line end at the end.
  for (const std::string header : {"OFF\n", "OFF ", "NOFF # normals\n", "nOFF 3\n", "", "OFF"}) {
    std::string text = header + "300 100 0\n";
    for (int n = 0; n < 300; ++n) text += n % 3 == 0 ? "0 0 0\n" : n % 3 == 1 ? "1 0 0\n" : "0 1 0\n";
    for (int n = 0; n < 100; ++n) text += "3 0 1 2\n";
    text.pop_back();
    write_text(scratch / "short.off", text);
    INFO(header);
    CHECK(read_mesh(scratch / "short.off").face_vertex_counts.size() == 100);
    text.resize(text.size() - 7);
    write_text(scratch / "short.off", text);
    CHECK_THROWS_WITH(read_mesh(scratch / "short.off"), Contains("short.off: ends before face 100 of 100"));
  }
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    std::string header;
    for (const char* line :
         {"ply", "format ascii 1.0", "comment element vertex 9999999", "element vertex 300", "property char x",
          "element face 1", "property list uchar int vertex_indices", "end_header"})
      header += line + end;
    std::string rest;
    for (int n = 0; n < 300; ++n) rest += std::to_string(n % 3) + end;
    rest += "3 0 1 2";
    write_text(scratch / "short.ply", header + rest);
    CHECK(read_mesh(scratch / "short.ply").face_vertex_counts.size() == 1);
    header.replace(header.find("300"), 3, "3000000000");
    write_text(scratch / "short.ply", header + rest);
    CHECK_THROWS_WITH(read_mesh(scratch / "short.ply"), Contains("short.ply: vertex 302: the file ends before it"));
  }
  for (const char* first : {"ply", "plyA", "PLY", "ply "}) {
    write_text(scratch / "cut.ply", first + std::string("\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"));
    CHECK_THROWS_WITH(read_mesh(scratch / "cut.ply"), Contains("cut.ply: its header has no line end_header"));
  }
  write_text(scratch / "none.ply", "");
  CHECK_THROWS_WITH(read_mesh(scratch / "none.ply"), Contains("none.ply: not a readable .ply file"));
}

TEST_CASE("A list of a PLY file that announces more entries than there are is refused, as text and in binary",
          "[law]") {
  const Scratch scratch;
  const auto header = [](const std::string& format, int faces) {
    return "ply\nformat " + format + " 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
           "element face " + std::to_string(faces) +
           "\nproperty list uchar int vertex_indices\nproperty list uint float weights\nend_header\n";
  };
  const auto check = [&](const std::string& text) {
    write_text(scratch / "lists.ply", text);
    plain_ply(scratch / "lists.ply");
  };
  const std::string ascii = header("ascii", 2) + "0 0 0\n\n1 0 0\n0 1 0\n";
  CHECK_NOTHROW(check(ascii + "3 0 1 2 1 0.5\r\n3 0 2 1 0"));
  CHECK_NOTHROW(check(ascii + "3 0 1 2 1 0.5 and more\n3 0 2 1 0\n"));
  CHECK_THROWS_WITH(check(ascii + "3 0 1 2 1 0.5\n"), Contains("lists.ply: face 2: the file ends before it"));
  CHECK_THROWS_WITH(check(ascii + "3 0 1 -2 1 0.5\n"), Contains("lists.ply: face 1: '-2' is no number of a vertex"));
  CHECK_THROWS_WITH(check(ascii + "3 0 1 2 1 0.5\n22906492240 0 1 2\n"),
                    Contains("lists.ply: face 2: its line has fewer entries than the 22906492240 it announces"));
  CHECK_THROWS_WITH(check(ascii + "3 0 1 2 1\n"), Contains("face 1: its line has fewer entries than the 1 it"));
  for (const char* word : {"#", "-1", "2.5", "nan", "3a"})
    CHECK_THROWS_WITH(check(ascii + word + " 0 1 2\n"),
                      Contains("face 1: '" + std::string(word) + "' is no number of entries of a list"));
  CHECK_THROWS_WITH(check(ascii + "3 0 1 2\n"), Contains("face 1: '' is no number of entries of a list"));
  CHECK_THROWS_WITH(check(header("ascii", 2) + "0 0 0\n1 0\n0 1 0\n3 0 1 2 1 0.5\n"),
                    Contains("lists.ply: vertex 2: its line has fewer numbers than it has properties"));

  for (const bool little : {true, false}) {
    INFO(little);
    const auto word = [&](std::uint32_t value) {
      std::string bytes;
      for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> 8 * (little ? i : 3 - i) & 255u);
      return bytes;
    };
    std::string begin = header(little ? "binary_little_endian" : "binary_big_endian", 1);
    begin.append(36, '\0').append("\3").append(12, '\0');  // the vertices, and the first list of a face
    CHECK_NOTHROW(check(begin + word(2) + std::string(8, '\0')));
    CHECK_THROWS_WITH(check(begin + word(3) + std::string(8, '\0')),
                      Contains("lists.ply: face 1: a list of 3 entries, more than the rest of the file holds"));
    CHECK_THROWS_WITH(check(begin + word(4000000000u)), Contains("face 1: a list of 4000000000 entries"));
    CHECK_THROWS_WITH(check(begin + "\1"), Contains("lists.ply: face 1: the file ends within it"));
    CHECK_THROWS_WITH(check(begin.substr(0, begin.size() - 14)), Contains("vertex 3: the file ends within it"));
    std::string negative = begin;
    negative.replace(negative.find("uchar"), 5, "char").replace(negative.find('\3'), 1, "\377");
    CHECK_THROWS_WITH(check(negative), Contains("face 1: a list with a negative number of entries"));
  }
}

TEST_CASE("Of a PLY file assimp is given points and corners alone, and never a header that leads it astray", "[law]") {
  const Scratch scratch;
  const std::string begin = "ply\nformat ascii 1.0\n", xyz = "property float x\nproperty float y\nproperty float z\n";
  const std::string vertices = "element vertex 3\n" + xyz, points = "0 0 0\n1 0 0\n0 1 0\n";
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n", end = "end_header\n";
  const auto plain = [&](const std::string& text) {
    write_text(scratch / "odd.ply", text);
    return plain_ply(scratch / "odd.ply");
  };
  const std::string expected = begin + vertices + faces + end + points + "3 0 1 2\n";
  CHECK(plain(expected) == expected);
  // Comments, other elements and properties, faces first, line ends of each kind, and none at the end.
  CHECK(plain("PLY\r\nformat ascii 1.0\r\ncomment property list uchar int vertex_indices\r\nelement face 1\r\n"
              "property list uchar float texcoord\r\nproperty list uchar int vertex_indices\r\nelement edge 1\r\n"
              "property int a\r\nelement vertex 3\r\nproperty uchar red\r\n" +
              xyz +
              "end_header\r\n"
              "8 0 0 0 0 0 0 0 0 3 0 1 2\r\n\r\n7\r\n9 0 0 0\r9 1 0 0\n\n\n9 0 1 0") == expected);
  const auto refused = [&](const std::string& text, const std::string& reason) {
    CHECK_THROWS_WITH(plain(text), Contains("odd.ply: " + reason));
  };
  const std::string rest = end + points + points;
  refused(begin + vertices + "element vertex 4\n" + xyz + faces + rest, "its header has more than one element vertex");
  refused(begin + vertices + faces + faces + rest, "its header has more than one element face");
  refused(begin + vertices + faces + "property list uchar int vertex_indices\n" + rest,
          "its face has more than one property vertex_indices");
  refused(begin + vertices + faces + "element tristrips 1\nproperty list int int vertex_indices\n" + rest,
          "has triangle strips, which are not read");
  refused(begin + "element vertex 3\nproperty float nx\n" + faces + rest,
          "its header has no element vertex with coordinates");
  refused(begin + vertices + "element face 1\nproperty list uchar float texcoord\n" + rest,
          "has no faces: its header has no element face with a list vertex_indices");
  refused(begin + "element vertex x\n" + xyz + rest, "its header has an element without a number: element vertex x");
  refused(begin + vertices + "property f\n" + rest, "its header has a property without a known type: property f");
  refused("ply\nformat text 1.0\n" + vertices + faces + rest,
          "not a readable .ply file: its header has no known format");
}

TEST_CASE("Bytes of a binary PLY file are read whole where the first one is a line feed") {
  const Scratch scratch;
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nelement face 1\nproperty uchar flag\n"
      "property list uchar int vertex_index\nend_header\n";
  const float points[3][3] = {{1.00000119f, 0, 0}, {2, 0, 0}, {0, 1, 0}};
  for (const auto& point : points) text.append(reinterpret_cast<const char*>(point), sizeof point).append("\7");
  REQUIRE(text[text.find("end_header\n") + 11] == '\n');
  text.append("\1\3");
  for (const std::int32_t corner : {0, 1, 2}) text.append(reinterpret_cast<const char*>(&corner), sizeof corner);
  write_text(scratch / "feed.ply", text);
  const PolygonMesh mesh = read_mesh(scratch / "feed.ply");
  REQUIRE(mesh.points.size() == 3);
  for (int i = 0; i < 3; ++i) CHECK(mesh.points[i] == std::array<float, 3>{points[i][0], points[i][1], points[i][2]});
  CHECK(mesh.face_vertex_indices == std::vector<std::int32_t>{0, 1, 2});
}

TEST_CASE("Of an OFF file assimp is given points and corners alone, in lines that it can hold", "[law]") {
  const Scratch scratch;
  const auto plain = [&](const std::string& text) {
    write_text(scratch / "odd.off", text);
    return plain_off(scratch / "odd.off");
  };
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n", expected = "OFF\n3 1 0\n" + points + "3 0 1 2\n";
  CHECK(plain(expected) == expected);
  CHECK(plain("3 1 0\n" + points + "3 0 1 2") == expected);
  CHECK(plain("# " + std::string(9000, '-') +
              "\r\nSTCNOFF3 1 0 # counts\r\n\r\n0 0 0 0 0 1\r\n1 0 0 0 0 1\r\n# more\r\n"
              "0 1 0 0 0 1\r\n3 0 1 2 255 0 0") == expected);
  CHECK(plain("4nOFF 2\n3 3 0\n0 0 1\n1 0 1\n0 1 1\n2 0 1\n0\n3 0 1 2\n") ==
        "4OFF\n3 1 0\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n");
  const auto refused = [&](const std::string& text, const std::string& reason) {
    CHECK_THROWS_WITH(plain(text), Contains("odd.off: " + reason));
  };
  const std::string begin = "OFF\n3 1 0\n";
  refused("OFF BINARY\n3 1 0\n" + points, "not a readable .off file: 'BINARY' stands for its number of vertices");
  refused("nOFF 4\n3 1 0\n" + points, "has points of 4 coordinates, not of 1 to 3");
  refused(begin + "0 0 0\n1 0 0\n", "ends before vertex 3 of 3");
  refused(begin + points, "ends before face 1 of 1");
  refused(begin + "0 0 0\n1 0\n0 1 0\n", "vertex 2 has fewer than 3 coordinates");
  refused(begin + points + "=\n3 0 1 2\n", "face 1: '=' is no number of corners");
  refused(begin + points + "3 0 1\n", "face 1: its line has fewer than the 3 corners it announces");
  refused(begin + points + "3 0 1 3\n", "face 1: '3' is none of the 3 vertices, counted from 0");
  refused(begin + points + "10 0 1 2 0 1 2 0 1 2 0\n",
          "face 1 has 10 corners, more than the 9 that are read of an .off");
  refused(begin + "0 0 " + std::string(4095, '0') + "\n" + points, "vertex 1 has numbers of more than 4095 characters");
}

TEST_CASE("Of an OBJ file assimp is given points, faces and objects alone") {
  const Scratch scratch;
  const auto text = [&](const std::string& all) {
    write_text(scratch / "lines.obj", all);
    std::vector<std::string> names;
    return plain_obj(scratch / "lines.obj", names);
  };
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  CHECK(text("mtllib a.mtl\nvn 0 0 1\nvt 0\n" + triangle + "l 1\nl 1\nl 1 2 3\np 1 \\\n 2\nusemtl b\n# \f") ==
        triangle);
  CHECK(text("v 0 0 \\\r\n0\r\nv 1 0 0\f"
             "v 0 \\\\\n1 0\n\nf 1 2 \\\n\\\n3\\") == triangle);
  for (const char* empty : {"", "o a\nf 1 2 3\n", "vn 0 0 1\n"})
    CHECK_THROWS_WITH(text(empty), Contains("lines.obj: not a readable .obj file: it contains no mesh"));
  // Behind two lines of one point a third one would be written behind the points.
  write_text(scratch / "lines.obj", triangle + "l 1\nl 1\nl 1 2 3\n");
  CHECK(read_mesh(scratch / "lines.obj").face_vertex_counts == std::vector<std::int32_t>{3});
}

TEST_CASE("An STL file has its header blank, or begins with its first word") {
  const Scratch scratch;
  const auto plain = [&](const std::string& text) {
    write_text(scratch / "odd.stl", text);
    return plain_stl(scratch / "odd.stl");
  };
  const std::string cube = cube_stl(), solid = "solid a\nendsolid a\n";
  std::string marked = cube;
  marked.replace(0, 16, std::string("\xFE\xFF\0\0 COLOR=1234", 16));
  CHECK(plain(marked) == cube);
  CHECK(plain("\xEF\xBB\xBF  \t" + solid) == solid);
  for (const std::string& text :
       {std::string("\xFE\xFF\0\0solid", 9), std::string("facet"), cube + "\n", std::string()})
    CHECK_THROWS_WITH(plain(text), Contains("odd.stl: not a readable .stl file: "));
}
