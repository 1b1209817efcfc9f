/// How to simplify.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Also merge vertices of different components that are near each other, so that many separate objects end in
    /// few roots.
    pub merge_components: bool,
}
