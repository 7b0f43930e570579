//! Listings: the public gallery, one listing, and its changes.

use axum::Json as Answer;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::text::{lines, one_line, refused};
use crate::auth::{Caller, MaybeCaller};
use crate::db::product::{Order, ProductFilter, ProductRow, ProductText};
use crate::error::{Error, Problem, Result};
use crate::extract::{Json, Query};
use crate::model::{Category, Condition, Role, Scope, Status};
use crate::state::App;
use crate::views::{Product, ProductCard};

/// Listings on a page, when nothing is said, and at most.
const PER_PAGE: (i64, i64) = (24, 100);
const MOST_PAGES: i64 = 1_000_000;
const TITLE_CHARS: usize = 200;
const DESCRIPTION_CHARS: usize = 20_000;
/// Above this a price is a typing error.
const MOST_PRICE: i64 = 1_000_000_000_000;

#[derive(Debug, Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Sort {
    #[default]
    Newest,
    PriceAsc,
    PriceDesc,
}

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct Search {
    /// Words to be found in title or description.
    q: Option<String>,
    #[serde(default, deserialize_with = "empty_as_none")]
    #[param(value_type = Option<Category>)]
    category: Option<Category>,
    #[serde(default)]
    #[param(required = false, inline)]
    sort: Sort,
    page: Option<i64>,
    per_page: Option<i64>,
}

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Gallery {
    items: Vec<ProductCard>,
    page: i64,
    per_page: i64,
    total: i64,
    /// Categories that have public listings.
    categories: Vec<CategoryCount>,
}

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct CategoryCount {
    name: Category,
    count: i64,
}

#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct NewProduct {
    title: String,
    description: Option<String>,
    /// In the currency's smallest unit, together with `currency`.
    price_minor: Option<i64>,
    currency: Option<String>,
    category: Option<Category>,
    condition: Option<Condition>,
}

/// What is absent stays; null takes price, currency or condition away.
#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct ProductChange {
    title: Option<String>,
    description: Option<String>,
    #[serde(default)]
    #[schema(value_type = Option<i64>)]
    price_minor: Change<i64>,
    #[serde(default)]
    #[schema(value_type = Option<String>)]
    currency: Change<String>,
    category: Option<Category>,
    #[serde(default)]
    #[schema(value_type = Option<Condition>)]
    condition: Change<Condition>,
}

#[derive(Debug, Deserialize, ToSchema)]
pub(super) struct StatusChange {
    status: Status,
}

/// A change of what may be absent: JSON tells "not named" from "null".
#[derive(Debug, Default)]
enum Change<T> {
    #[default]
    Keep,
    TakeAway,
    Set(T),
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Change<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        Option::deserialize(deserializer).map(|value| value.map_or(Self::TakeAway, Self::Set))
    }
}

impl<T> Change<T> {
    fn of(self, before: Option<T>) -> Option<T> {
        match self {
            Self::Keep => before,
            Self::TakeAway => None,
            Self::Set(value) => Some(value),
        }
    }
}

/// Forms send `category=` for "any".
pub(super) fn empty_as_none<'de, D: Deserializer<'de>, T: crate::model::Word>(
    deserializer: D,
) -> std::result::Result<Option<T>, D::Error> {
    let text = Option::<String>::deserialize(deserializer)?.filter(|text| !text.is_empty());
    let unknown = |text: &str| serde::de::Error::custom(format!("{text:?} is not one of the values"));
    text.map(|text| T::from_word(&text).ok_or_else(|| unknown(&text))).transpose()
}

/// Page and page size within bounds.
pub(super) fn paging(page: Option<i64>, per_page: Option<i64>) -> (i64, i64) {
    (page.unwrap_or(1).clamp(1, MOST_PAGES), per_page.unwrap_or(PER_PAGE.0).clamp(1, PER_PAGE.1))
}

/// A listing with its ETag.
pub(super) async fn answer(app: &App, status: StatusCode, row: &ProductRow) -> Result<Response> {
    let product = Product::new(row, &app.db.files(&row.id).await?);
    let mut response = (status, Answer(product)).into_response();
    let etag = HeaderValue::from_str(&format!("\"v{}\"", row.version)).map_err(Error::internal)?;
    response.headers_mut().insert(header::ETAG, etag);
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    Ok(response)
}

/// The listing as it is now.
pub(super) async fn answer_now(app: &App, status: StatusCode, id: &str) -> Result<Response> {
    let row = app.db.product(id).await?.ok_or_else(|| Error::not_found("product"))?;
    answer(app, status, &row).await
}

/// The public gallery: active listings.
#[utoipa::path(get, path = "/api/products", tag = "products", params(Search), responses((status = 200, body = Gallery)))]
pub(super) async fn list(State(app): State<App>, Query(search): Query<Search>) -> Result<Answer<Gallery>> {
    let (page, per_page) = paging(search.page, search.per_page);
    let filter = ProductFilter {
        words: search.q,
        category: search.category,
        status: Some(Status::Active),
        owner_id: None,
        order: match search.sort {
            Sort::Newest => Order::Newest,
            Sort::PriceAsc => Order::PriceAscending,
            Sort::PriceDesc => Order::PriceDescending,
        },
        limit: per_page,
        offset: (page - 1) * per_page,
    };
    let (rows, total) = app.db.products(&filter).await?;
    let categories = app.db.categories().await?;
    let categories = categories.into_iter().map(|(name, count)| CategoryCount { name, count }).collect();
    Ok(Answer(Gallery {
        items: rows.iter().map(ProductCard::from).collect(),
        page,
        per_page,
        total,
        categories,
    }))
}

/// One listing.
#[utoipa::path(get, path = "/api/products/{id}", tag = "products", params(("id" = String, Path)),
    responses((status = 200, body = Product), (status = 404, body = Problem)))]
pub(super) async fn show(
    State(app): State<App>,
    caller: MaybeCaller,
    Path(id): Path<String>,
) -> Result<Response> {
    let row = caller.visible_product(&app, &id).await?;
    answer(&app, StatusCode::OK, &row).await
}

/// Make a draft.
#[utoipa::path(post, path = "/api/products", tag = "products", request_body = NewProduct,
    responses((status = 201, body = Product), (status = 422, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    caller: Caller,
    Json(body): Json<NewProduct>,
) -> Result<Response> {
    caller.require(Scope::Upload)?;
    let text = ProductText {
        title: one_line("title", &body.title, TITLE_CHARS)?,
        description: lines(
            "description",
            body.description.as_deref().unwrap_or_default(),
            DESCRIPTION_CHARS,
        )?,
        price: price(body.price_minor, body.currency)?,
        category: body.category.unwrap_or(Category::Other),
        condition: body.condition,
    };
    let id = app.db.insert_product(&caller.account.id, &text).await?;
    let mut response = answer_now(&app, StatusCode::CREATED, &id).await?;
    let location = HeaderValue::from_str(&format!("/api/products/{id}")).map_err(Error::internal)?;
    response.headers_mut().insert(header::LOCATION, location);
    Ok(response)
}

/// A draft with only a title.
pub(super) async fn create_titled(app: &App, caller: &Caller, title: &str) -> Result<String> {
    let text = ProductText {
        title: one_line("title", title, TITLE_CHARS)?,
        description: String::new(),
        price: None,
        category: Category::Other,
        condition: None,
    };
    Ok(app.db.insert_product(&caller.account.id, &text).await?)
}

/// Change the text of a listing, in the version that `If-Match` names.
#[utoipa::path(patch, path = "/api/products/{id}", tag = "products", request_body = ProductChange,
    params(("id" = String, Path), ("If-Match" = String, Header, description = "The ETag of what was edited")),
    responses((status = 200, body = Product), (status = 404, body = Problem), (status = 412, body = Problem),
        (status = 422, body = Problem), (status = 428, body = Problem)))]
pub(super) async fn edit(
    State(app): State<App>,
    caller: Caller,
    Path(id): Path<String>,
    headers: HeaderMap,
    Json(body): Json<ProductChange>,
) -> Result<Response> {
    caller.require(Scope::Manage)?;
    let row = caller.own_product(&app, &id).await?;
    let expected = if_match(&headers, row.version)?;
    let text = changed(row.text, body)?;
    if expected != row.version || !app.db.edit_product(&row.id, expected, &text).await? {
        let detail =
            "Somebody changed this listing meanwhile. Load it again and make your change on the new version.";
        return Err(Error::refuse(StatusCode::PRECONDITION_FAILED, "edited_meanwhile", detail));
    }
    answer_now(&app, StatusCode::OK, &row.id).await
}

/// The version named by `If-Match`; `*` is any. What is no version of ours matches none.
fn if_match(headers: &HeaderMap, current: i64) -> Result<i64> {
    let missing = || {
        let detail = "Send If-Match with the ETag of the listing you edited.";
        Error::refuse(StatusCode::PRECONDITION_REQUIRED, "if_match_missing", detail)
    };
    let value = headers.get(header::IF_MATCH).ok_or_else(missing)?.to_str().unwrap_or_default().trim();
    if value == "*" {
        return Ok(current);
    }
    let number = value.strip_prefix("\"v").and_then(|rest| rest.strip_suffix('"'));
    Ok(number.and_then(|number| number.parse().ok()).unwrap_or(-1))
}

fn changed(before: ProductText, change: ProductChange) -> Result<ProductText> {
    let (amount, currency) = before.price.unzip();
    Ok(ProductText {
        title: change.title.map_or(Ok(before.title), |title| one_line("title", &title, TITLE_CHARS))?,
        description: change
            .description
            .map_or(Ok(before.description), |text| lines("description", &text, DESCRIPTION_CHARS))?,
        price: price(change.price_minor.of(amount), change.currency.of(currency))?,
        category: change.category.unwrap_or(before.category),
        condition: change.condition.of(before.condition),
    })
}

fn price(amount: Option<i64>, currency: Option<String>) -> Result<Option<(i64, String)>> {
    match (amount, currency) {
        (None, None) => Ok(None),
        (Some(amount), Some(currency)) => {
            if !(0..=MOST_PRICE).contains(&amount) {
                return Err(refused("price_minor", "must not be negative or absurdly large"));
            }
            if currency.len() != 3 || !currency.bytes().all(|b| b.is_ascii_uppercase()) {
                return Err(refused("currency", "must be three capital letters, as EUR"));
            }
            Ok(Some((amount, currency)))
        }
        _ => Err(refused("price_minor and currency", "go together: send both or neither")),
    }
}

/// Activate, take back, archive. Only an admin activates.
#[utoipa::path(post, path = "/api/products/{id}/status", tag = "products", request_body = StatusChange,
    params(("id" = String, Path)),
    responses((status = 200, body = Product), (status = 403, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem)))]
pub(super) async fn set_status(
    State(app): State<App>,
    caller: Caller,
    Path(id): Path<String>,
    Json(body): Json<StatusChange>,
) -> Result<Response> {
    caller.require(Scope::Manage)?;
    let row = caller.own_product(&app, &id).await?;
    if body.status == Status::Active && caller.account.role != Role::Admin {
        let detail = "Only an admin makes a listing public; ask one to look at it.";
        return Err(Error::forbidden("not_admin", detail));
    }
    if !app.db.set_status(&row.id, body.status).await? {
        let detail = "This listing has no 3D model yet; upload one first.";
        return Err(Error::conflict("no_model", detail));
    }
    answer_now(&app, StatusCode::OK, &row.id).await
}

/// Delete a draft or an archived listing with its files.
#[utoipa::path(delete, path = "/api/products/{id}", tag = "products", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub(super) async fn delete(
    State(app): State<App>,
    caller: Caller,
    Path(id): Path<String>,
) -> Result<StatusCode> {
    caller.require(Scope::Manage)?;
    let row = caller.own_product(&app, &id).await?;
    let active = || Error::conflict("active", "This listing is public; take it back or archive it first.");
    let unused = app.db.delete_product(&row.id).await?.ok_or_else(active)?;
    app.delete_unused(unused).await;
    Ok(StatusCode::NO_CONTENT)
}
