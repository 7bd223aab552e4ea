use std::path::Path;

use credence_types::{Point, PointCloud};
use proptest::prelude::*;

use super::*;

fn read(mut bytes: &[u8]) -> Result<PointCloud, String> {
    read::parse(&mut bytes).map_err(|fault| fault.in_file(Path::new("cup.ply")).to_string())
}

fn fault(bytes: &[u8]) -> String {
    let message = read(bytes).unwrap_err();
    assert!(message.starts_with("cup.ply "), "{message}");
    message
}

fn written(cloud: &PointCloud) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cup.ply");
    write_point_cloud(cloud, &path).unwrap();
    std::fs::read(path).unwrap()
}

fn cloud(points: &[([f64; 3], [u8; 3])]) -> PointCloud {
    let mut cloud = PointCloud::default();
    for (point, rgb) in points {
        cloud.push(Point::from(*point), *rgb);
    }
    cloud
}

fn two_points() -> PointCloud {
    cloud(&[
        ([0.1, -0.25, 3.0], [1, 2, 3]),
        ([-0.0, 1e-300, 5.0], [255, 0, 128]),
    ])
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";
const RGB: &str = "property uchar red\nproperty uchar green\nproperty uchar blue\n";

fn file(format: &str, header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = format!("ply\nformat {format} 1.0\n{header}end_header\n").into_bytes();
    bytes.extend(data);
    bytes
}

#[test]
fn one_point_byte_for_byte() {
    let bytes = written(&cloud(&[([1.0, -2.0, 0.0], [7, 8, 9])]));
    let header = "element vertex 1\nproperty double x\nproperty double y\nproperty double z\n";
    let mut data = vec![0, 0, 0, 0, 0, 0, 0xf0, 0x3f, 0, 0, 0, 0, 0, 0, 0, 0xc0];
    data.extend([0, 0, 0, 0, 0, 0, 0, 0, 7, 8, 9]);
    let expected = file("binary_little_endian", &format!("{header}{RGB}"), &data);
    assert_eq!(bytes, expected);
}

#[test]
fn a_point_and_its_spread_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cup.ply");
    write_spread_cloud(&[Point::new(1.0, -2.0, 0.0)], &[0.5], &path).unwrap();
    let header = "element vertex 1\nproperty double x\nproperty double y\nproperty double z\n";
    let values = [1.0_f64, -2.0, 0.0, 0.5].map(f64::to_le_bytes).concat();
    let header = format!("{header}property double spread\n");
    let expected = file("binary_little_endian", &header, &values);
    assert_eq!(std::fs::read(&path).unwrap(), expected);

    let message = |points: &[Point], spread_m: &[f64]| {
        let refused = write_spread_cloud(points, spread_m, &path).unwrap_err();
        refused.to_string()
    };
    let origin = Point::origin();
    assert!(message(&[origin], &[]).contains("1 points and 0 spreads"));
    let nan = Point::new(f64::NAN, 0.0, 0.0);
    assert!(message(&[origin, nan], &[0.0; 2]).contains("point 1 is at (NaN, 0, 0)"));
    assert_eq!(std::fs::read(&path).unwrap(), expected);
}

#[test]
fn passes_over_what_it_does_not_need() {
    // Colours first, a normal and a list among the coordinates, elements before and after.
    let header = "comment made by hand\r\nobj_info none\r\n\
        element camera 2\nproperty list uchar short views\n\
        element vertex 2\nproperty uint8 blue\nproperty uint8 green\nproperty uint8 red\n\
        property float64 z\nproperty float nx\nproperty list uint8 int32 ids\n\
        property float32 y\nproperty float x\n\
        element face 1\nproperty list uchar int vertex_indices\n";
    struct Row {
        bgr: [u8; 3],
        z: f64,
        nx: f32,
        ids: &'static [i32],
        yx: [f32; 2],
    }
    let rows = [
        Row {
            bgr: [3, 2, 1],
            z: 0.3,
            nx: 9.0,
            ids: &[5, -6],
            yx: [0.25, 0.5],
        },
        Row {
            bgr: [6, 5, 4],
            z: 0.6,
            nx: f32::NAN,
            ids: &[],
            yx: [-0.5, -1.5],
        },
    ];
    let expected = cloud(&[
        ([0.5, 0.25, 0.3], [1, 2, 3]),
        ([-1.5, -0.5, 0.6], [4, 5, 6]),
    ]);

    let encode = |big: bool| {
        let mut data = Vec::new();
        let mut push = |little: &[u8]| {
            let mut bytes = little.to_vec();
            if big {
                bytes.reverse();
            }
            data.extend(bytes);
        };
        push(&[2]);
        push(&(-1_i16).to_le_bytes());
        push(&7_i16.to_le_bytes());
        push(&[0]);
        for row in &rows {
            for colour in row.bgr {
                push(&[colour]);
            }
            push(&row.z.to_le_bytes());
            push(&row.nx.to_le_bytes());
            push(&[row.ids.len() as u8]);
            for id in row.ids {
                push(&id.to_le_bytes());
            }
            for coordinate in row.yx {
                push(&coordinate.to_le_bytes());
            }
        }
        push(&[3]);
        for corner in [0_i32, 1, 0] {
            push(&corner.to_le_bytes());
        }
        data
    };
    let little = file("binary_little_endian", header, &encode(false));
    assert_eq!(read(&little).unwrap(), expected);
    let big = file("binary_big_endian", header, &encode(true));
    assert_eq!(read(&big).unwrap(), expected);
    let text = "2 -1 7\n0\n3 2 1 0.3 9 2 5 -6 0.25 5e-1\n6 5 4 0.6 nan 0 -0.5\n-1.5\n3 0 1 0\n\n";
    let ascii = file("ascii", header, text.as_bytes());
    assert_eq!(read(&ascii).unwrap(), expected);
}

#[test]
fn says_what_is_wrong_with_a_header() {
    let vertex = |properties: &str| format!("element vertex 0\n{properties}");
    let cases = [
        (
            String::new(),
            "no element 'vertex'; export the cloud with x, y, z",
        ),
        (vertex(RGB), "its vertices have no property 'x'; export"),
        (vertex(XYZ), "its vertices have no property 'red'; export"),
        (
            vertex(&format!("{XYZ}{}", RGB.replace("uchar", "float"))),
            "the type of vertex property 'red' is F32; export",
        ),
        (
            vertex(&format!("{}{RGB}", XYZ.replace("float", "int"))),
            "the type of vertex property 'x' is I32",
        ),
        (
            vertex(&format!("{XYZ}{XYZ}{RGB}")),
            "vertex property 'x' stands there twice",
        ),
        (
            vertex(&format!("{XYZ}{RGB}")).repeat(2),
            "several elements 'vertex'",
        ),
        (vertex(""), "element 'vertex' has no property"),
        (
            "element vertex -1\n".to_owned(),
            "header line 'element vertex -1' is not",
        ),
        (
            XYZ.to_owned(),
            "header line 'property float x' is not understood",
        ),
        (
            vertex("property half x\n"),
            "header line 'property half x' is not understood",
        ),
        (
            vertex("property list float int ids\n"),
            "header line 'property list float int ids' is not understood",
        ),
        (
            "format utf8 1.0\n".to_owned(),
            "the format 'utf8' is none of PLY's three",
        ),
        (
            "format ascii 2.0\n".to_owned(),
            "header line 'format ascii 2.0' is not",
        ),
    ];
    for (header, expected) in cases {
        let message = fault(&file("ascii", &header, b""));
        assert!(message.contains(expected), "{message}");
    }
    let message = fault(b"ply\nelement vertex 0\nend_header\n");
    assert!(message.contains("the header has no 'format'"), "{message}");
    for wrong in [&b""[..], b"PLY\n", b"# Octomap OcTree file\n", &[0; 10_000]] {
        let message = fault(wrong);
        assert!(
            message.contains("first line is not 'ply'; pass a PLY file"),
            "{message}"
        );
    }
}

#[test]
fn says_what_is_wrong_with_the_data() {
    let header = |rows: u64| format!("element vertex {rows}\n{XYZ}{RGB}");
    let ascii = |rows, text: &str| fault(&file("ascii", &header(rows), text.as_bytes()));
    assert!(ascii(1, "0 0 0 1 2").contains("it ends too early"));
    assert!(ascii(1, "0 0 0 1 2 3 4").contains("'4' follows where the data should end"));
    assert!(ascii(1, "0 0 0 1 2 256").contains("'256' is not a value of type U8"));
    assert!(ascii(1, "0 0 zero 1 2 3").contains("'zero' is not a value of type F32"));
    assert!(ascii(1, "0 nan 0 1 2 3").contains("vertex 0 is at (0, NaN, 0); remove"));
    assert!(ascii(1, &"1".repeat(600)).contains("longer than 512 bytes"));
    assert!(ascii(u64::MAX, "0 0 0 1 2 3").contains("it ends too early"));

    let binary = |rows, data: &[u8]| fault(&file("binary_little_endian", &header(rows), data));
    assert!(binary(0, &[0]).contains("bytes follow where the data should end"));
    assert!(binary(u64::MAX, &[0; 100]).contains("it ends too early"));
    let infinite = [&f32::INFINITY.to_le_bytes()[..], &[0; 11]].concat();
    assert!(binary(1, &infinite).contains("vertex 0 is at (inf, 0, 0)"));

    let list = |count: i32| {
        let header = format!("element vertex 1\nproperty list int double ids\n{XYZ}{RGB}");
        let data = [&count.to_le_bytes()[..], &[0; 100]].concat();
        fault(&file("binary_little_endian", &header, &data))
    };
    assert!(list(-1).contains("a list has -1 items"));
    assert!(list(i32::MAX).contains("it ends too early"));
}

#[test]
fn refuses_clouds_that_no_reader_takes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cup.ply");
    let refusal = |cloud: &PointCloud| write_point_cloud(cloud, &path).unwrap_err().to_string();
    let mut uncoloured = two_points();
    uncoloured.rgb.pop();
    let message = refusal(&uncoloured);
    assert!(
        message.contains("cup.ply was not written: the cloud has 2 points and 1 colours; give")
    );
    let message = refusal(&cloud(&[([0.0, f64::NAN, 1.0], [0; 3])]));
    assert!(
        message.contains("point 0 is at (0, NaN, 1); remove the points"),
        "{message}"
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn no_prefix_of_a_file_is_one() {
    let bytes = written(&two_points());
    assert_eq!(read(&bytes).unwrap(), two_points());
    for length in 0..bytes.len() {
        fault(&bytes[..length]);
    }
}

proptest! {
    #[test]
    fn files_give_the_same_cloud(
        points in prop::collection::vec(
            (prop::array::uniform3(prop::num::f64::NORMAL | prop::num::f64::ZERO), any::<[u8; 3]>()),
            0..40,
        )
    ) {
        let cloud = cloud(&points);
        prop_assert_eq!(read(&written(&cloud)).unwrap(), cloud);
    }

    #[test]
    fn no_bytes_panic(
        ascii: bool,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let header = format!(
            "element vertex 2\nproperty list uchar int ids\n{XYZ}{RGB}element face 1\nproperty int a\n"
        );
        let mut bytes = if ascii {
            file("ascii", &header, b"1 5 0.5 1 2 3 4 5\n0 -1 2e0 3 4 5 6\n7\n")
        } else {
            file("binary_little_endian", &header, &[0; 36])
        };
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(cloud) = read(&bytes) {
            prop_assert_eq!(read(&written(&cloud)).unwrap(), cloud);
        }
    }
}
