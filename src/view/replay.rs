//! What a user did, as a text file: written while it happens, and done again later.
//!
//! A line an event: seconds since the start, then `down KEY`, `up KEY` (names as in the keys file),
//! `drag look|orbit|pan X Y` (mouse pixels), `wheel NOTCHES`, `at X Y` (where the cursor is, in parts of the window),
//! `click`, `region X Y X Y` (a rectangle, in such parts), `open FILE` or `quit`. `#` begins a comment.
//! Numbers that are changed on a card are not in it.

use super::chord::Chord;
use super::input::Drag;
use glam::DVec2;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use winit::keyboard::KeyCode;

/// Something that a user did.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A key went down or up.
    Key(KeyCode, bool),
    /// The mouse was dragged to the right and down.
    Drag(Drag, f64, f64),
    /// The wheel turned.
    Wheel(f64),
    /// The cursor is here, from the upper left corner at 0 to the lower right one at 1.
    At(DVec2),
    /// A click there.
    Click,
    /// A rectangle was drawn between these places.
    Region([DVec2; 2]),
    /// A file was opened.
    Open(PathBuf),
    /// The end.
    Quit,
}

impl Event {
    fn parse(words: &[&str]) -> Result<Self, String> {
        let number = |text: &str| {
            let number: Result<f64, _> = text.parse();
            number.ok().filter(|n| n.is_finite()).ok_or_else(|| format!("\"{text}\" is not a number"))
        };
        match *words {
            ["down", key] => Ok(Self::Key(Chord::parse(key)?.code, true)),
            ["up", key] => Ok(Self::Key(Chord::parse(key)?.code, false)),
            ["drag", what, x, y] => {
                let drag = match what {
                    "look" => Drag::Look,
                    "orbit" => Drag::Orbit,
                    "pan" => Drag::Pan,
                    _ => return Err(format!("\"{what}\": a drag is look, orbit or pan")),
                };
                Ok(Self::Drag(drag, number(x)?, number(y)?))
            }
            ["wheel", notches] => Ok(Self::Wheel(number(notches)?)),
            ["at", x, y] => Ok(Self::At(DVec2::new(number(x)?, number(y)?))),
            ["click"] => Ok(Self::Click),
            ["region", a, b, c, d] => {
                let place = |x, y| Ok::<_, String>(DVec2::new(number(x)?, number(y)?));
                Ok(Self::Region([place(a, b)?, place(c, d)?]))
            }
            ["quit"] => Ok(Self::Quit),
            _ => Err(format!(
                "\"{}\" is no event: down, up, drag, wheel, at, click, region, open or quit",
                words.join(" ")
            )),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Key(code, down) => format!("{} {code:?}", if *down { "down" } else { "up" }),
            Self::Drag(drag, x, y) => format!("drag {} {x} {y}", format!("{drag:?}").to_lowercase()),
            Self::Wheel(notches) => format!("wheel {notches}"),
            Self::At(place) => format!("at {:.5} {:.5}", place.x, place.y),
            Self::Click => "click".to_owned(),
            Self::Region([a, b]) => format!("region {:.5} {:.5} {:.5} {:.5}", a.x, a.y, b.x, b.y),
            Self::Open(path) => format!("open {}", path.display()),
            Self::Quit => "quit".to_owned(),
        }
    }
}

/// Events to come, in the order of their times.
#[derive(Clone, Debug, Default)]
pub struct Replay {
    events: Vec<(Duration, Event)>,
    done: usize,
    start: Option<Instant>,
}

impl Replay {
    /// Reads a file.
    ///
    /// # Errors
    /// One line with the file and the place in it.
    pub fn open(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        Self::parse(&text).map_err(|why| format!("{}: {why}", path.display()))
    }

    fn parse(text: &str) -> Result<Self, String> {
        let mut events: Vec<(Duration, Event)> = Vec::new();
        for (line, number) in text.lines().zip(1..) {
            let words: Vec<&str> = line.split('#').next().unwrap_or("").split_whitespace().collect();
            let [time, event @ ..] = words.as_slice() else { continue };
            let wrong = |why: String| format!("line {number}: {why}");
            // Names of files may be anything.
            let file = line.trim_start().split_once(" open ").map(|(_, file)| PathBuf::from(file));
            let time: f64 =
                time.parse().map_err(|_| wrong(format!("\"{time}\" is not a time in seconds")))?;
            let time = Duration::try_from_secs_f64(time).map_err(|error| wrong(error.to_string()))?;
            if events.last().is_some_and(|(last, _)| *last > time) {
                return Err(wrong("it comes before the one above".to_owned()));
            }
            let event = match (event, file) {
                (["open", ..], Some(file)) => Event::Open(file),
                _ => Event::parse(event).map_err(wrong)?,
            };
            events.push((time, event));
        }
        Ok(Self { events, done: 0, start: None })
    }

    /// The events whose time has come, counted from the first call.
    pub fn due(&mut self, now: Instant) -> Vec<Event> {
        let start = *self.start.get_or_insert(now);
        let rest = &self.events[self.done..];
        let count = rest.iter().take_while(|(at, _)| start + *at <= now).count();
        self.done += count;
        rest[..count].iter().map(|(_, event)| event.clone()).collect()
    }

    /// When the next one comes.
    #[must_use]
    pub fn next(&self) -> Option<Instant> {
        Some(self.start? + self.events.get(self.done)?.0)
    }
}

/// Writes down what happens.
#[derive(Debug)]
pub struct Recorder {
    file: BufWriter<File>,
    start: Option<Instant>,
}

impl Recorder {
    /// Into this file, anew.
    ///
    /// # Errors
    /// One line with the file.
    pub fn create(path: &Path) -> Result<Self, String> {
        let file = File::create(path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(Self { file: BufWriter::new(file), start: None })
    }

    /// From now on times are counted.
    pub fn begin(&mut self) {
        self.start.get_or_insert_with(Instant::now);
    }

    /// Notes that `event` happens now.
    pub fn note(&mut self, event: &Event) {
        let mut line = String::new();
        let seconds = self.start.map_or(0.0, |start| start.elapsed().as_secs_f64());
        let _ = writeln!(line, "{seconds:.4} {}", event.text());
        // A full disk is no reason to stop looking at a picture.
        let _ = self.file.write_all(line.as_bytes()).and_then(|()| self.file.flush());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let path = std::env::temp_dir().join(format!("penumbra-replay-{}", std::process::id()));
        let events = [
            Event::Key(KeyCode::KeyW, true),
            Event::Key(KeyCode::ArrowLeft, false),
            Event::Drag(Drag::Orbit, -1.5, 2.0),
            Event::Wheel(-1.0),
            Event::At(DVec2::new(0.25, 0.5)),
            Event::Click,
            Event::Region([DVec2::ZERO, DVec2::new(0.5, 0.75)]),
            Event::Open(PathBuf::from("two  words #2.glb")),
            Event::Quit,
        ];
        let mut recorder = Recorder::create(&path).unwrap();
        recorder.begin();
        events.iter().for_each(|event| recorder.note(event));
        let mut replay = Replay::open(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let now = Instant::now();
        replay.due(now);
        let rest = Replay { start: Some(now), done: 0, ..replay }.due(now + Duration::from_secs(1));
        assert_eq!(rest, events);
    }

    #[test]
    fn events_come_at_their_times_and_mistakes_have_lines() {
        let mut replay = Replay::parse("# fly\n0.5 down W\n\n1 up W # let go\n1 quit").unwrap();
        let now = Instant::now();
        assert_eq!(replay.due(now), []);
        assert_eq!(replay.next(), Some(now + Duration::from_millis(500)));
        assert_eq!(replay.due(now + Duration::from_millis(600)), [Event::Key(KeyCode::KeyW, true)]);
        assert_eq!(replay.due(now + Duration::from_secs(9)).len(), 2);
        assert_eq!(replay.next(), None);
        for (text, said) in [
            ("1 down W\n0.5 up W", "line 2: it comes before"),
            ("x down W", "line 1: \"x\" is not a time"),
            ("-1 quit", "line 1: "),
            ("1 jump", "line 1: \"jump\" is no event"),
            ("1 drag look 1 nan", "line 1: \"nan\" is not a number"),
            ("1 down Wibble", "line 1: \"Wibble\": no key"),
        ] {
            let error = Replay::parse(text).unwrap_err();
            assert!(error.starts_with(said), "{error}");
        }
    }
}
