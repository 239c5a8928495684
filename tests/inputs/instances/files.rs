//! Files of positions: what is read, and what is refused with its place.

use super::*;
use glam::{DQuat, DVec3};
use proptest::prelude::*;

fn read_bytes(bytes: &[u8]) -> Result<Vec<InstanceTransform>, Error> {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("at.csv"), bytes).unwrap();
    let scene = scene_in(directory.path(), &sphere("1 mm"), "\"at.csv\"").unwrap();
    transforms(&scene, &scene.objects[0])
}

fn read(text: &str) -> Result<Vec<InstanceTransform>, Error> {
    read_bytes(text.as_bytes())
}

#[test]
fn columns_of_any_order_and_unit_are_read() {
    let expected = [(DVec3::new(1e-3, -2e-6, 0.03), 1.0), (DVec3::new(0.1e-3, 5e-6, 0.0), 1.0)];
    for text in [
        "x_mm,y_um,z_cm\n1,-2,3\n0.1,5,0\n",
        "\u{feff}\"z_cm\",\"x_mm\",\"y_um\"\r\n3, 1, -2\r\n0,0.1,5",
        "z_cm;x_mm;y_um\r3; 1; -2\r0;0.1;5\r",
        "# from a scan\n\nz_m , y_nm,x_pm,scale\n0.03,-2e3,1e9,1\n# more\n0,5000,1e8,1.0\n\n",
    ] {
        let found = read(text).unwrap();
        let found: Vec<_> = found.iter().map(|it| (it.position, it.scale)).collect();
        assert_eq!(found, expected, "{text:?}");
    }
}

#[test]
fn order_is_scale_then_rotation_then_position() {
    let axis_angle = "x_m,y_m,z_m,scale,axis_x,axis_y,axis_z,angle_deg\n1,2,3,2,0,0,5,90\n";
    let radians = "x_m,y_m,z_m,scale,axis_x,axis_y,axis_z,angle_rad\n1,2,3,2,0,0,-1e-200,-1.5707963267948966\n";
    let quaternion = "qw,qx,qy,qz,scale,x_m,y_m,z_m\n7,0,0,7,2,1,2,3\n";
    for text in [axis_angle, radians, quaternion] {
        let found = read(text).unwrap()[0];
        let turned = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        assert!(found.rotation.angle_between(turned) < 1e-7, "{found:?}");
        assert!((found.rotation.length() - 1.0).abs() < 1e-15);
        let there = found.affine().transform_point3(DVec3::new(1.0, 0.5, 0.25));
        assert!((there - DVec3::new(0.0, 4.0, 3.5)).length() < 1e-12, "{there}");
    }
}

#[test]
fn a_million_rows_are_read_and_no_more() {
    let row = "0.125,-3.5,7.25,1.5,0.5,0.5,0.5,0.5\n";
    let text = format!("x_mm,y_mm,z_mm,scale,qw,qx,qy,qz\n{}", row.repeat(1_000_000));
    let begin = std::time::Instant::now();
    assert_eq!(read(&text).unwrap().len(), 1_000_000);
    println!("1e6 rows in {:.2} s", begin.elapsed().as_secs_f64());
    let error = read(&format!("{text}{row}")).unwrap_err().to_string();
    assert!(
        error.contains("at.csv:1000002:1") && error.contains("more than 1000000 rows"),
        "{error}"
    );
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = read_bytes(&bytes);
    }

    #[test]
    fn no_text_like_a_table_makes_the_reader_panic(
        header in "((x|y|z)_(mm|m|um)|scale|angle_deg|axis_[xyz]|q[wxyz]|\"|,| |#){0,12}",
        rows in "[-0-9eE.,\"\\r\\n #naif]{0,120}",
    ) {
        for header in ["", "x_mm,y_mm,z_mm\n", "x_mm,y_mm,z_mm,qw,qx,qy,qz\n", &header] {
            for found in read(&format!("{header}{rows}")).into_iter().flatten() {
                prop_assert!(found.position.is_finite() && found.scale > 0.0);
                prop_assert!((found.rotation.length() - 1.0).abs() < 1e-12);
            }
        }
    }
}
