//! No command replaces what it reads, nor files of others.

use super::{contents, ends, simulate, workplace};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

#[test]
fn pictures_pages_and_images_never_replace_what_they_are_made_of() {
    let place = workplace();
    simulate(place.path(), "");
    let at = |name: &str| place.path().join(name);
    ends(place.path(), "example cylinders -o given", 0);
    ends(place.path(), "spectrum --anode W --kvp 60kV --plot tube.svg", 0);
    fs::write(at("table.svg"), "10,1\n20,3\n30,1\n").unwrap();
    fs::create_dir(at("d.partial")).unwrap();
    fs::create_dir(at("images")).unwrap();
    for step in 0..4 {
        let name = format!("step_{step:03}.exr");
        fs::copy(at("run/flat").join(&name), at("d.partial").join(&name)).unwrap();
    }
    let before = contents(place.path());
    for (line, code) in [
        ("simulate run/scene.toml -o run --overwrite", 1),
        ("report run -o run/run.json --overwrite", 1),
        ("report run -o run/./progress.log --overwrite", 1),
        ("view run -o run/flat --overwrite", 1),
        ("spectrum table.svg --plot ./table.svg --overwrite", 1),
        ("retrieve run -o run --overwrite", 1),
        ("retrieve run -o run/sample/images", 1),
        ("compare d.partial run/flat --difference d", 2),
        ("compare run/flat run/flat --difference run/flat/d", 2),
    ] {
        ends(place.path(), line, code);
        assert_eq!(contents(place.path()), before, "{line}");
    }
    ends(place.path(), "compare run/flat run/flat --difference images", 0);
    assert!(at("images/stack").is_dir() && !at("images.partial").exists());
    assert_eq!(contents(&at("images")).len(), 4);
}

#[test]
fn retrieved_images_are_replaced_without_the_files_of_others() {
    let place = workplace();
    simulate(place.path(), "");
    let at = |name: &str| place.path().join(name);
    ends(place.path(), "retrieve run -o images -q", 0);
    // In a folder of images, and under the names that are needed beside them.
    for file in ["images/refraction/notes.txt", "images.replaced/thesis.tex"] {
        fs::create_dir_all(at(file).parent().unwrap()).unwrap();
        fs::write(at(file), "mine").unwrap();
        let before = contents(place.path());
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        let message = ends(place.path(), "retrieve run -o images -q --overwrite", 1);
        assert!(message.contains(name) || message.contains("images.replaced"), "{message}");
        assert_eq!(contents(place.path()), before, "{file}");
        fs::remove_file(at(file)).unwrap();
    }
    fs::remove_dir(at("images.replaced")).unwrap();
    // A link in place of images that are to be replaced, and one in place of the images of a run.
    fs::create_dir(at("elsewhere")).unwrap();
    fs::write(at("elsewhere/thesis.tex"), "mine").unwrap();
    for (name, line) in [("images.replaced", "images"), ("run/retrieved", "run/retrieved")] {
        symlink(at("elsewhere"), at(name)).unwrap();
        let before = contents(place.path());
        let message = ends(place.path(), &format!("retrieve run -o {line} -q --overwrite"), 1);
        assert!(message.contains(&format!("{name}: is a link")), "{message}");
        assert_eq!(contents(place.path()), before, "{name}");
        if name == "run/retrieved" {
            fs::remove_file(at("elsewhere/thesis.tex")).unwrap();
            for line in ["retrieve run -q", "retrieve run -o run/retrieved/ -q"] {
                let message = ends(place.path(), line, 1);
                assert!(message.contains("run/retrieved: is a link"), "{message}");
            }
        }
        fs::remove_file(at(name)).unwrap();
    }
    // A link to a scratch disk stays one.
    fs::create_dir(at("scratch")).unwrap();
    fs::rename(at("images"), at("scratch/images")).unwrap();
    symlink("scratch/images", at("images")).unwrap();
    ends(place.path(), "retrieve run -o images -q --overwrite --format npy", 0);
    assert!(at("images").is_symlink());
    assert!(at("scratch/images/refraction.npy").exists());
    assert_eq!(fs::read_dir(at("scratch")).unwrap().count(), 1);
}
