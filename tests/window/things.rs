//! Keys that edit the scene: what they do is what the settings file says that they save.

use super::desktop::{difference, wait_for};
use super::watched::{ROOM, Watched, upper};
use image::RgbImage;

/// Closes the card, and saves the edits: what the window shows is what the printed command renders. Returns that, and
/// the settings file.
fn saved(watched: &Watched, what: &str) -> (RgbImage, String) {
    watched.keys(&["Escape"]);
    let said = watched.answer("ctrl+e");
    let words: Vec<&str> = said.split_whitespace().collect();
    assert_eq!(words[..2], ["penumbra", "render"], "{said}");
    let rendered = watched.run(&[&words[1..], &["--spp", "4"]].concat());
    watched.shows_picture(what, &rendered);
    let file = words.iter().position(|&word| word == "--scene-settings").unwrap() + 1;
    (rendered, std::fs::read_to_string(watched.desktop.directory.join(words[file])).unwrap())
}

/// [`ROOM`] without the lines from the one that says `from` to the next table.
fn without(watched: &Watched, from: &str) -> RgbImage {
    let (before, rest) = ROOM.split_at(ROOM.find(from).unwrap());
    let end = rest[2..].find("\n[").unwrap() + 3;
    watched.desktop.write("less.toml", &format!("{before}{}", &rest[end..]));
    watched.run(&["render", "less.toml", "--resolution", "320x240", "--spp", "4"])
}

const LAMP: &str = "[[light]]\nkind = 'parallelogram'";
const BLUE: &str = "[[model]]\nfile = 'blue.obj'";
const RED: &str = "[[model]]\nfile = 'red.obj'";

#[test]
fn things_are_gone_through_in_their_order_and_hidden_as_if_they_were_not_there() {
    let Some(watched) = Watched::room("hide") else {
        return;
    };
    let whole = watched.rendered(&[]);
    watched.cursor(160, 115);
    // The first light, the last thing, and what is under the cursor; each comes back in another way.
    for (what, select, back, from) in [
        ("no lamp", &["ctrl+Next"][..], "Delete", LAMP),
        ("no blue box", &["ctrl+Prior"], "BackSpace", BLUE),
        ("no lamp, by ten and back", &["ctrl+Next", "ctrl+Next", "ctrl+Prior"], "ctrl+z", LAMP),
        ("no red box", &["m"], "BackSpace", RED),
    ] {
        let less = without(&watched, from);
        assert!(difference(&upper(&whole), &upper(&less)) > 0.005, "{what} changes nothing");
        watched.keys(select);
        watched.keys(&["Delete", "Escape"]);
        watched.shows_picture(what, &less);
        // What is not there any more is still gone through.
        if back == "Delete" {
            watched.keys(select);
        }
        watched.keys(&[back, "Escape"]);
        watched.shows_picture(&format!("all again after {back}"), &whole);
    }
}

/// Mean of the channels, left of the card.
fn light(picture: &RgbImage) -> [f64; 3] {
    let sum = picture.pixels().fold([0.0; 3], |sum, p| [0, 1, 2].map(|i| sum[i] + f64::from(p[i])));
    sum.map(|c| c / f64::from(picture.width() * picture.height()))
}

#[test]
fn numbers_are_changed_taken_back_and_saved() {
    let Some(watched) = Watched::room("numbers") else {
        return;
    };
    let whole = watched.rendered(&[]);
    watched.shows_picture("the room", &whole);
    let before = light(&upper(&whole));
    // The power is the seventh number of a lamp; more of the eighth, red, there cannot be.
    watched.keys(&["ctrl+Next"]);
    watched.keys(&["ctrl+Down"; 7]);
    watched.keys(&["ctrl+Up"]);
    let changes: [(&[&str], &str, bool); 3] = [
        (&["ctrl+shift+Right"], "more light", true),
        (&["ctrl+Left", "ctrl+shift+Left"], "less light", false),
        (&["ctrl+Right", "ctrl+Right"], "a little more", true),
    ];
    let mut pictures = vec![whole.clone()];
    for (keys, what, brighter) in changes {
        watched.keys(keys);
        let (picture, file) = saved(&watched, what);
        let now = light(&upper(&picture));
        assert_eq!(now[0] > before[0] && now[1] > before[1], brighter, "{what}: {before:?} to {now:?}");
        assert!(file.contains("[[edit]]") && file.contains("spectra"), "{file}");
        // Escape closed the card: back to the number.
        watched.keys(&["ctrl+Next"]);
        watched.keys(&["ctrl+Down"; 6]);
        pictures.push(picture);
    }
    assert!(light(&upper(&pictures[3]))[0] > light(&upper(&pictures[2]))[0]);
    // Steps of one number are taken back together or one by one, but in the end all is as it was.
    watched.keys(&["BackSpace"; 6]);
    watched.keys(&["Escape"]);
    watched.shows_picture("the room as it was", &whole);
}

#[test]
fn a_copy_stands_beside_what_it_is_of() {
    let Some(watched) = Watched::room("copy") else {
        return;
    };
    let whole = watched.rendered(&[]);
    watched.cursor(160, 115);
    watched.keys(&["m", "ctrl+d"]);
    let (picture, file) = saved(&watched, "two red boxes");
    assert!(file.contains("copy_of"), "{file}");
    let red = |picture: &RgbImage| {
        picture.pixels().filter(|p| p[0] > 60 && u32::from(p[0]) > 3 * u32::from(p[1].max(p[2]))).count()
    };
    let [one, two] = [&whole, &picture].map(|picture| red(&upper(picture)));
    assert!(two > one + one / 3, "{one} red pixels, then {two}");
    watched.keys(&["BackSpace", "Escape"]);
    watched.shows_picture("one red box", &whole);
}

#[test]
fn f5_reads_what_nobody_has_noticed() {
    let Some(watched) = Watched::room("again") else {
        return;
    };
    watched.keys(&["Home"]);
    let camera = watched.seen("the whole scene");
    let flags: Vec<&str> = camera.flags.iter().map(String::as_str).collect();
    let before = watched.rendered(&flags);
    // As long and as old as before: nothing tells that it is another.
    let path = watched.desktop.directory.join("room.mtl");
    let old = std::fs::metadata(&path).unwrap().modified().unwrap();
    let text = std::fs::read_to_string(&path).unwrap().replace("0.8 0.8 0.8", "0.1 0.8 0.1");
    let new = watched.desktop.directory.join("new.mtl");
    std::fs::write(&new, text).unwrap();
    std::fs::File::options().append(true).open(&new).unwrap().set_modified(old).unwrap();
    std::fs::rename(new, path).unwrap();
    let after = watched.rendered(&flags);
    assert!(difference(&upper(&before), &upper(&after)) > 0.02);
    super::desktop::pause(1000);
    watched.shows_picture("the picture as it was", &before);
    watched.keys(&["F5"]);
    watched.shows_picture("a green floor, from the same place", &after);
    wait_for("nothing else", || (watched.camera() == camera).then_some(()));
}
