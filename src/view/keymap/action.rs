//! What keys can mean.

/// Something that lasts as long as its key is down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// Move along the line of sight.
    Forward,
    /// Move against the line of sight.
    Back,
    /// Move to the left.
    Left,
    /// Move to the right.
    Right,
    /// Move along the world's +Y.
    Up,
    /// Move along the world's −Y.
    Down,
    /// Turn to the left.
    LookLeft,
    /// Turn to the right.
    LookRight,
    /// Turn upwards.
    LookUp,
    /// Turn downwards.
    LookDown,
    /// Move faster; coarser steps of other keys.
    Fast,
    /// Move slower.
    Slow,
    /// Show the kept picture.
    Compare,
    /// The other meaning of another key.
    Control,
}

impl Hold {
    /// How many there are.
    pub const COUNT: usize = Self::Control as usize + 1;
}

/// A direction to look along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is the side of the scene that is seen")]
pub enum Side {
    Front,
    Back,
    Right,
    Left,
    Top,
    Bottom,
}

/// Something that happens once per key press.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tap {
    /// Multiply the base speed.
    Faster,
    /// Divide the base speed.
    Slower,
    /// Fly, or turn about the pivot.
    Navigation,
    /// Pivot and focal plane to the point under the cursor.
    Focus,
    /// The whole scene in view.
    FrameAll,
    /// Back to the camera that the window opened with.
    ResetCamera,
    /// The file's previous camera.
    PreviousCamera,
    /// The file's next camera.
    NextCamera,
    /// From one side of the scene.
    View(Side),
    /// Perspective or parallel.
    Orthographic,
    /// A larger lens.
    OpenLens,
    /// A smaller lens, at last none.
    CloseLens,
    /// To a place remembered, 1 to 9.
    Recall(u8),
    /// Remember this place, 1 to 9.
    Remember(u8),
    /// Print the camera as command line flags.
    PrintCamera,
    /// Stop refining, or go on.
    Pause,
    /// Play the animations, or stop.
    Play,
    /// The animations' picture before.
    StepBack,
    /// The animations' next picture.
    StepOn,
    /// Throw away all samples.
    Restart,
    /// Exposure down.
    Darker,
    /// Exposure up.
    Brighter,
    /// Exposure by what is seen.
    AutoExposure,
    /// Next tone map.
    ToneMap,
    /// What the colours stand for.
    PixelView,
    /// Explain the pixel under the cursor, or no pixel any more.
    Pin,
    /// The left mouse button, without a drag.
    Click,
    /// No boxes of the hierarchy, those of a level, those of the leaves.
    Boxes,
    /// Boxes of a higher level.
    LevelUp,
    /// Boxes of a lower level.
    LevelDown,
    /// One box more on the way of the pinned pixel's ray.
    NextStep,
    /// One box fewer.
    PreviousStep,
    /// Near first or priority queue.
    Order,
    /// Edit what is under the cursor.
    Select,
    /// Edit what it moves with.
    SelectParent,
    /// Edit the thing before, in the order of all things.
    PreviousThing,
    /// Edit the next thing.
    NextThing,
    /// The number above.
    PreviousRow,
    /// The number below.
    NextRow,
    /// Less of it.
    Less,
    /// More of it.
    More,
    /// Leave it out of the picture, or not.
    Hide,
    /// Another one beside it.
    Duplicate,
    /// Take the last edit back.
    Undo,
    /// Do again what was taken back.
    Redo,
    /// Keep the edits in a file.
    SaveEdits,
    /// Next texture filter.
    Filter,
    /// Next integrator.
    Integrator,
    /// Keep old samples while moving, or not.
    KeepSamples,
    /// Smooth the first second, or not.
    Smooth,
    /// Refine a part of the picture only, or all of it again.
    Crop,
    /// Ask for another scene.
    Open,
    /// Show or hide what loading has found.
    Report,
    /// Show or hide the curve of the noise.
    Graph,
    /// Next level of detail of the status lines.
    HudLevel,
    /// Show or hide the help.
    Help,
    /// Full screen or window.
    FullScreen,
    /// Save what the window shows.
    ScreenshotWithHud,
    /// Save the picture alone.
    Screenshot,
    /// Save all that is known of the picture, linear and developed.
    SavePicture,
    /// Load the scene again.
    Reload,
    /// Keep the picture to compare with.
    Keep,
    /// Show the picture to compare with beside this one, or not.
    Split,
    /// Compare with the reference or with the kept picture.
    OtherSide,
    /// Close what is open.
    Escape,
    /// End the program.
    Quit,
}

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// While it is down.
    Hold(Hold),
    /// Once per press.
    Tap(Tap),
}
